"""A model in service: samples arrive one at a time, some are lost, future waves are not known.

:class:`Live` follows a vessel sample by sample. A Kalman filter on the delayed states fills what
was not measured (:mod:`seakeep.core.kalman`); a forecast starts from its estimate, as
:meth:`HankelDMDcModel.forecast` starts from a measured history.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from itertools import compress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from scipy import special

from seakeep.arrays import (
    TINY,
    BoolArray,
    FloatArray,
    IntArray,
    as_real,
    as_table,
    check_choice,
    fraction,
    plain,
    positive,
    ratio,
    undefined,
    whole_number,
)
from seakeep.conventions import is_elevation
from seakeep.core.kalman import DelayFilter, process_noise
from seakeep.core.recursion import read_row
from seakeep.errors import RequestError, did_you_mean
from seakeep.executor import one_blas_thread
from seakeep.files import load_sealed, write_sealed
from seakeep.models import engine, store
from seakeep.models.engine import Dynamics
from seakeep.models.forecasts import (
    Model,
    departure,
    label_channels,
    rows_by_name,
    statistic_coordinate,
    weighed,
)
from seakeep.models.growth import WINDOWS, LeadErrors
from seakeep.models.inputs import Scale, Signature
from seakeep.models.labelled import Span
from seakeep.models.validity import Conditions, Validity
from seakeep.signals.prediction import (
    Foreseen,
    Jumps,
    close_gaps,
    fill_future,
    foresee,
    predictable_time,
)

STATE = "live state"
"""Kind of the files of :meth:`Live.save`."""
RECORD = 16
"""Record that is kept, in longest delays: what waves are predicted from."""
LEAST_RECORD = 512
"""Samples of record that are kept at least."""
CONSISTENCY = 256
"""Samples over which the consistency is averaged, as a time constant; twice as many as a free run
lasts, at least, where it is that of free runs. After a fault as many, or a free run, suffice."""
SPIKE = 100.0
"""What a single sample adds to the consistency at most: a spike tells of a sensor, for a while."""
ALARM = 2.0
"""Consistency of a state above which errors of late are no longer those of training."""
LATE = 16
"""Complete samples that are judged together: each alone would cost three times as much."""
AFTER = 32
"""Samples after a gap from which on what comes is predicted from them alone."""
SMOOTH = 0.01
"""Part of a channel's SD in training that the RMS of its third differences is at least."""
MOTIONS = ("m", "rad", "m/s", "rad/s")
"""Units of states in which no sample jumps; loads and accelerations know impacts."""
SMALL = 0.5
"""Part of the training SD below which an error stays over the lead time."""
RIG = ("water_depth", "celerity", "probe_offset")
"""Attributes of a run that an alignment reads."""


class Servable(Model):
    """A model that can go into service."""

    @property
    def _serving(self) -> tuple[Model, Sequence[Dynamics], LeadErrors | None]:
        """What forecasts in service, what its filter predicts with, and errors in training."""
        raise NotImplementedError

    def live(
        self,
        *,
        like: xr.Dataset | None = None,
        noise: Mapping[str, float] | None = None,
        roles: Mapping[str, str] | None = None,
    ) -> Live:
        """Put the model into service: samples in one at a time, estimates and forecasts out.

        The filter of an ensemble predicts with the mean of the members, or with what they are
        centred on, whose errors on what they learnt from are found here; a forecast runs all of
        them.

        Parameters
        ----------
        like, noise, roles
            As in :class:`seakeep.models.Live`.

        Returns
        -------
        Live
            Without samples yet.

        Raises
        ------
        RequestError
            If the model holds no errors of its training, or an argument is out of range.
        """
        return Live(*self._serving, like=like, noise=noise, roles=roles)


class _Update(NamedTuple):
    """What the filter makes of one sample.

    Gain, shape (N(s+1), N), and standard deviations of the innovation, shape (N,).
    """

    gain: FloatArray
    deviations: FloatArray


class _Closed(NamedTuple):
    """Inputs of the record with short gaps closed.

    Which waves are lost then, shape (time, wave), and for how many of the last samples all are.
    """

    record: FloatArray
    lost: BoolArray
    dark: int


@dataclass
class _Counts:
    """Counts of samples, by which a service goes on.

    Parameters
    ----------
    taken : int
        All, or as many as have room: the place of the next one among the rows that are kept.
    since : int
        Those since the whole history was measured.
    partly : bool
        Whether anything was seen since then.
    complete : int
        Complete ones in a row.
    lead : int
        Those since the start of a free run.
    unseen : int
        Those in a row without any state.
    doubtful : int
        Those to come for which a jump of a state makes errors doubtful.
    """

    taken: int = 0
    since: int = 0
    partly: bool = True
    complete: int = 0
    lead: int = 0
    unseen: int = 0
    doubtful: int = 0


class Live:
    """A model that follows a vessel sample by sample; made by ``model.live()``.

    After :meth:`step` its time is that of the sample, and :attr:`state` estimates that instant;
    :meth:`forecast` gives the instants after it.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        What forecasts.
    members : sequence of Dynamics
        Its members; the filter predicts with the mean of their one-step predictions.
    errors : LeadErrors or None
        Its errors in training, from which the noises are taken.
    like : Dataset, optional
        A run with the attributes that hold in service (``water_depth``, ``celerity``,
        ``probe_offset``, and ``x_position`` of the inputs): what probes up-wave have seen then
        tells waves to come, and a model with an alignment may serve in another rig than it was
        trained in.
    noise : mapping of str to float, optional
        Standard deviations of the measurement noise of some states, in their units. Without them
        all residuals of training are process noise, which is what least squares makes of them:
        a measured state is taken as it is.
    roles : mapping of str to {"wave", "known", "constant"}, optional
        Of inputs. A wave, which is the default, is predicted where it is not measured. A known
        input is a plan, of a thrust, a towing speed or a valve: each forecast is given it. A
        constant one, and a known one that was not measured, stays at its last value.

    Raises
    ------
    RequestError
        If the model holds no errors, a noise is out of range, or there is no such role or input.
    """

    def __init__(
        self,
        model: Model,
        members: Sequence[Dynamics],
        errors: LeadErrors | None,
        *,
        like: xr.Dataset | None = None,
        noise: Mapping[str, float] | None = None,
        roles: Mapping[str, str] | None = None,
    ) -> None:
        model.signature.check_fixed()
        if errors is None:
            raise RequestError(
                "the model holds no errors of its training, from which a live model takes its "
                "noises: it is a member of an ensemble, which keeps them for all of its members. "
                "Use ensemble.hold().live()."
            )
        self.model, self.signature, self.errors = model, model.signature, errors
        signature = self.signature
        self._rig = _rig(signature, like)
        self._stated = _noise(signature, noise)
        self._noise = np.array([self._stated.get(name, 0.0) for name in signature.states])
        self._roles = _roles(signature, roles)
        self._waves = [at for at, name in enumerate(signature.inputs) if name not in self._roles]
        self._follows = signature.input_map.follows
        # In service only a model that follows its own surge carries waves, in this rig.
        self._own_rig = None if self._follows is None else self._rig
        aligned = signature.input_map.alignment if self._follows is None else None
        if aligned and (aligned.settings.carries or any(aligned.rig(self._rig).offsets)):
            raise RequestError(
                "the model is driven by waves that are carried over whole records, which are not "
                "there in service. Fit it with alignment mode = 'dispersion', surge = 'predicted', "
                "which carries them in each step, or without alignment."
            )
        self._gap = model.coverage.quarter(signature.dt)
        foresight = engine.foresight(signature, self._rig)
        self._places = foresight.keywords["positions"][self._waves]
        self._depth = foresight.keywords["depth"]
        self._foreseen = partial(foresight, positions=self._places)
        self._offset, self._a, self._b, self._d = _mean_predictor(members, signature)
        count, s = len(signature.states), signature.state_delays
        variances = self._noise**2
        process = process_noise(errors.residual, self._a, variances)
        self._filter = DelayFilter(self._a, process, variances)
        self._deviations = np.sqrt(np.diagonal(process) + variances)  # after complete samples
        # Errors of a model last, and those of the filter do not.
        excess = errors.rms[-1] / np.sqrt(np.maximum(self._filter.added_up(errors.longest), TINY))
        self._raised = np.where(variances > 0, 1.0, np.maximum(excess, 1.0))
        self._time = math.nan
        # Samples after an instant whose input is needed before its estimate is final.
        self._ahead = signature.lead_samples
        # Of a model that follows its own surge: filters that predict each probe from those up-wave
        # too, and rows at all places of the samples to come.
        self._foresight: FloatArray = np.empty(0)
        self._table: tuple[int, Any] = (0, None)
        if self._follows is not None:
            self._follows.banks(self._rig)  # refused here where probes stand too far away
            self._foresight = self._follows.foresight(self._rig, max(self._ahead, 1))
        # Rows of samples, from the first one on; half of the room is always there.
        longest = max(s, signature.input_delays) + 1
        self._begins = signature.history_samples
        self._record = max(LEAST_RECORD, 2 * (self._begins + self._ahead + 1), RECORD * longest)
        inputs = len(signature.inputs)
        widths = inputs, inputs, count, count, *(each.mean.size for each in signature.scales[1:])
        self._rows = [np.full((2 * self._record, width), np.nan) for width in (*widths, 2 * count)]
        self._u, self._lost, self._x, self._y, self._delayed, self._direct, self._apart = self._rows
        self._count = _Counts()
        self._jumps, self._jumped = Jumps(self._smoothest()), np.zeros(inputs + count, bool)
        # Of the samples whose estimates are not final; None of a complete sample after complete
        # ones, which is taken as it is.
        self._updates: list[_Update | None] = []
        self._history = np.tile(signature.state_scale.centre, (s + 1, 1))
        self._innovation = np.full(count, np.nan)
        # Of squares that fade: sums, and weights; of each state, and of each in free runs.
        self._squares = np.zeros((2, 2, count))
        free = max(CONSISTENCY, 2 * errors.longest)
        self._fade = 1.0 - 1.0 / np.array([[CONSISTENCY], [free]])
        self._free = self._history.copy()

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}(states={self.signature.states}, "
            f"inputs={self.signature.inputs}, dt={self.signature.dt:g}, time={self.time:g})"
        )

    @property
    def time(self) -> float:
        """Instant of the last sample, s; NaN before the first."""
        return self._time

    @property
    def ready(self) -> bool:
        """Whether there is enough history to forecast: ``history_samples`` of the model."""
        return self._count.taken >= self._begins

    @property
    def state(self) -> FloatArray:
        """Estimate of the states at :attr:`time`, shape (N,), physical units; NaN before that."""
        return self._x[max(self._count.taken - 1, 0)].copy()

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the errors of :attr:`state`, shape (N, N), but for those of lost waves.

        While nothing is measured, the first step of a forecast holds these too. Those of a state
        without stated noise are raised by the factor by which free runs in training err more than
        white noise adds up to, but not above the errors of free runs.
        """
        count = len(self.signature.states)
        known = self._filter.covariance[-count:, -count:]
        most = self.errors.at(self._count.since) / np.sqrt(np.maximum(np.diagonal(known), TINY))
        factor = np.minimum(self._raised, np.maximum(most, 1.0))
        return known * np.outer(factor, factor)

    @property
    def innovation(self) -> FloatArray:
        """Measurement minus one-step prediction, shape (N,), NaN for what was not measured.

        It belongs to the last instant whose prediction reads no wave that is still to come: the
        last sample, or with a look-ahead of l samples that of l − 1 samples before.
        """
        self._finish()
        return self._innovation.copy()

    @property
    def consistency(self) -> float:
        """Mean of :attr:`consistency_by_state`, NaN before the first prediction.

        One where errors are as in training, over the last few hundred samples. Well above one for
        longer than that, the model no longer fits the vessel, or a sensor its channel.
        """
        known = self.consistency_by_state
        return float(ratio(np.nansum(known), np.isfinite(known).sum()))

    @property
    def consistency_by_state(self) -> FloatArray:
        """Running mean of squared errors over those of training, shape (2, N).

        One step ahead, where errors are innovations, and in free runs. These start again and again
        from the estimate, are driven by the waves as they were measured, and last as long as those
        of training, whose errors at each lead they are compared with. A small error of each step
        that is always the same, as in waves outside the training, shows in the second row long
        before the first. NaN where there is none yet. Where the plain mean over the last 256
        samples, or as many as a free run lasts if these are more, is smaller, it is that.
        """
        self._finish()
        means: FloatArray = ratio(*self._squares)
        # Those of late alone forget what is over; what was not judged counts as the mean.
        late = self._of_late.reshape(-1, *means.shape) - means
        return means + np.minimum(np.nansum(late, axis=0) / max(len(late), 1), 0.0)

    @property
    def _of_late(self) -> FloatArray:
        """Squares of so many samples that free runs reach each lead, and 256 at least."""
        samples = max(CONSISTENCY, self.errors.longest)
        return self._apart[max(self._pending - samples, 0) : self._pending]

    @property
    def conditions(self) -> Conditions | None:
        """Waves, means of inputs and mean surge of the record, and those of training.

        None before 4 samples. Known and constant inputs are no waves: of them the mean alone is
        compared.
        """
        if self._count.taken < 4 or not self.signature.inputs:
            return None
        states, surge = self.signature.states, None
        if "surge" in states:
            surge = self._x[self._kept, states.index("surge")]
        return self.model.coverage.conditions(
            self._known_inputs(), self.signature, surge, waves=self._waves
        )

    @property
    def validity(self) -> Validity:
        """What lies outside the training: waves, means, or errors of late; or lost waves.

        Means are those of inputs and of the surge. Errors lie outside where
        :attr:`consistency_by_state` exceeds two for a state, one step ahead or in free runs, and
        for some samples after a state has jumped. Waves are lost while estimate or forecast go back
        to any that were not measured, beyond gaps of a quarter of their period, which are closed.
        While nothing at all is measured they are not: the band holds what they do.
        """
        return self._validity(self.conditions, self._closed())

    def _validity(self, conditions: Conditions | None, closed: _Closed) -> Validity:
        outside = Validity(0) if conditions is None else conditions.validity
        _, lost, dark = closed
        if dark <= self._count.unseen:  # the band holds what comes of it
            lost = lost[: len(lost) - dark]
        if lost[-self._begins - min(self._count.since, self.errors.longest) :].any():
            outside |= Validity.LOST
        alarm = self._count.doubtful > 0 or bool(np.any(self.consistency_by_state > ALARM))
        return outside | Validity.CONSISTENCY if alarm else outside

    @property
    def jumped(self) -> tuple[str, ...]:
        """Channels whose last sample was taken as lost, as no wave or motion jumps so far."""
        names = self.signature.inputs + self.signature.states
        return tuple(compress(names, self._jumped))

    def _smoothest(self) -> FloatArray:
        """RMS of third differences of inputs and states at least; infinite where they may jump."""
        signature, waves = self.signature, self._waves
        is_wave = [at in waves and is_elevation(name) for at, name in enumerate(signature.inputs)]
        moves = [label.units in MOTIONS for label in signature.state_labels]
        spread = np.concatenate([0.25 * self.model.coverage.heights, signature.state_scale.spread])
        is_smooth = np.array(is_wave + moves) & (spread > 0)
        return np.where(is_smooth, SMOOTH * spread, np.inf)

    @property
    def equations(self) -> dict[str, Any]:
        """What the filter computes with, for hosts: x' = offset + a x̂ + b û + d v, oldest first.

        Variances of process and measurement noise, and what inputs are predicted from: samples of
        their records, gaps that are closed, and filters of a model that follows its own surge.
        """
        return {
            "a": self._a,
            "b": self._b,
            "d": self._d,
            "offset": self._offset,
            "process": self._filter.process,
            "raised": self._raised,
            "noise": self._filter.noise,
            "record": self._record,
            "gap": self._gap,
            "foresight": self._foresight,
            "waves": self._waves,
            "smoothest": self._jumps.least,
            "doubtful": self._ahead + LATE,
        }

    @one_blas_thread()
    def step(
        self,
        u: npt.ArrayLike | Mapping[str, float] | None = None,
        y: npt.ArrayLike | Mapping[str, float] | None = None,
        time: float | None = None,
    ) -> FloatArray:
        """Take one sample, and estimate the states at its instant.

        Parameters
        ----------
        u : array_like, shape (Q,), or mapping of names to numbers, optional
            Measured inputs at this instant, physical units. What is missing (NaN, or left out of
            a mapping) is predicted from the samples before, and from the probe up-wave where
            positions are known.
        y : array_like, shape (N,), or mapping of names to numbers, optional
            Measured states at this instant, with what is missing as in `u`.
        time : float, optional
            Instant of the sample, s, to check that none was left out: one step after the last, to a
            hundredth of a step. By default just that; the first is 0.

        Returns
        -------
        ndarray, shape (N,)
            :attr:`state`. What jumps as no wave or motion does is missing: :attr:`jumped`.

        Raises
        ------
        RequestError
            If a length, a name or the time does not fit, or a value is infinite. Nothing has
            changed then, and the same sample can be given again.
        """
        signature, count = self.signature, self._count
        instant = self._instant(time)
        sample = [_sample("u", u, signature.inputs), _sample("y", y, signature.states)]
        if count.taken < 4 and np.isnan(sample[0]).any():
            raise RequestError(
                f"inputs that are missing are predicted from the samples before, and there are "
                f"{count.taken}. Start with at least 4 samples of all of u; of a probe that is "
                "dead, with its mean, or fit a model without it."
            )
        row = np.concatenate(sample)
        self._jumped = self._jumps.of(row)
        row[self._jumped] = np.nan
        inputs, states = np.split(row, [len(signature.inputs)])
        filled = self._filled(inputs)
        if count.taken == len(self._u):  # all room is used up
            for rows in self._rows:
                rows[: self._record] = rows[self._record :]
            count.taken = self._record
        at = count.taken
        self._u[at], self._lost[at], self._y[at] = filled, np.isnan(inputs), states
        # Held until it is estimated: an alignment reads where the vessel is.
        self._x[at] = np.where(np.isfinite(states), states, self._x[at - 1])
        count.taken += 1
        count.doubtful = max(count.doubtful - 1, 0)
        if self._jumped[inputs.size :].any():
            count.doubtful = self._ahead + LATE
        self._time = instant
        self._filtered(at, np.isfinite(states))
        self._settle(at)
        return self.state

    def _instant(self, time: float | None) -> float:
        dt = self.signature.dt
        expected = 0.0 if math.isnan(self._time) else self._time + dt
        if time is None:
            return expected
        instant = float(as_real(time, "time"))
        if not math.isfinite(instant):
            raise RequestError(f"time must be a finite instant in seconds; received {time!r}.")
        if math.isnan(self._time) or abs(instant - expected) <= 0.01 * dt:
            return instant
        if instant <= self._time:
            raise RequestError(
                f"time = {instant:.15g} s is not after the last sample at {self._time:.15g} s. "
                "Samples must come in the order of their instants, each once."
            )
        raise RequestError(
            f"time = {instant:.15g} s is {instant - self._time:g} s after the last sample, and "
            f"the model steps by {dt:g} s, to a hundredth. Call step() without arguments once for "
            "each sample that was lost; resample the rest to the model's step, as "
            "campaign.live_chain does."
        )

    def _filled(self, inputs: FloatArray) -> FloatArray:
        """Inputs of a sample; what was lost comes from each record, and from the probe up-wave."""
        lost = np.isnan(inputs)
        if not lost.any():
            return inputs
        foreseen = self._foreseen if self.ready and self._follows is None else foresee
        return np.where(lost, self._expected(self._known_inputs(), 1, foreseen)[0], inputs)

    def _expected(
        self, known: FloatArray, count: int, foreseen: Callable[..., Foreseen] = foresee
    ) -> FloatArray:
        """Inputs of the next samples: in waves as those of training, or from each record."""
        out, waves = np.repeat(known[-1:], count, axis=0), self._waves
        if self._follows is not None and self.ready:
            taps, placed = self._foresight, list(self._follows.placed)
            means = self.signature.input_scale.mean[placed]
            last = known[len(known) - taps.shape[3] :, placed] - means
            out[:, placed] = np.einsum("cqpt,tp->cq", taps[:count], last) + means
            waves = [each for each in waves if each not in placed]
        if waves:
            out[:, waves] = foreseen(known[:, waves], count).expected
        return out

    @property
    def _kept(self) -> slice:
        """Samples that waves are predicted from: as many as there are, up to so many."""
        return slice(max(self._count.taken - self._record, 0), self._count.taken)

    def _known_inputs(self) -> FloatArray:
        """Inputs of these samples."""
        return self._u[self._kept]

    def _closed(self) -> _Closed:
        """The record with short gaps closed."""
        record, lost = self._known_inputs().copy(), self._lost[self._kept] > 0
        for column in self._waves:
            close_gaps(record[:, column], lost[:, column], self._gap)
        lost = lost[:, self._waves]
        dark = np.logical_and.accumulate(lost[::-1].all(axis=1) & bool(self._waves)).sum()
        return _Closed(record, lost, int(dark))

    def _filtered(self, at: int, seen: BoolArray) -> None:
        """Covariance and gain of a sample."""
        count, scale, kalman = self._count, self.signature.state_scale, self._filter
        count.unseen = 0 if seen.any() else count.unseen + 1
        count.partly |= bool(seen.any())
        is_exact = bool(seen.all()) and not self._noise.any()
        update = None
        if not is_exact or count.since or at < self._begins:
            # Unmeasured, errors grow over free runs as long as those of training, and a history.
            settled = self.errors.longest + self.signature.state_delays
            if at < self._begins:
                kalman.shift(np.diag(scale.spread**2))
            elif count.partly or count.since < settled:
                kalman.shift()
                limits = self.errors.at(count.since + 1) ** 2
                kalman.limit(limits, exactly=not count.partly)
            variances = np.diagonal(kalman.covariance)[-seen.size :]
            deviations = np.sqrt(variances + self._noise**2)
            update = _Update(kalman.measure(seen), deviations)
        self._updates.append(update)
        count.complete = count.complete + 1 if is_exact else 0
        if count.complete <= self.signature.state_delays:
            count.since += 1
            return
        if count.since:  # or it is zero already
            kalman.covariance.fill(0.0)
        count.since, count.partly = 0, False

    def _settle(self, at: int) -> None:
        """Bring estimates up to the sample `at`: final ones, then those that waves to come move."""
        if at < self._begins:
            self._advance(self._history, 1)
            self._updates.clear()
            return
        self._finish(LATE)
        if not any(self._updates):
            return
        known = self._known_inputs()
        if self._ahead and self.signature.inputs:
            known = np.concatenate([known, self._expected(known, self._ahead)])
        self._find_rows(at, known)
        self._advance(self._history.copy(), len(self._updates))

    def _finish(self, late: int = 0) -> None:
        """Judge samples whose estimates no wave to come moves; up to `late` complete ones wait."""
        final = len(self._updates) - max(self._ahead - 1, 0)
        if final > (0 if any(self._updates) else late):
            self._find_rows(self._pending + final - 1, self._known_inputs())
            self._advance(self._history, final, is_final=True)
            del self._updates[:final]

    @property
    def _pending(self) -> int:
        """Number of the first sample whose estimate is not final."""
        return self._count.taken - len(self._updates)

    def _advance(self, history: FloatArray, count: int, *, is_final: bool = False) -> None:
        """Run the mean through the next samples, with the gains that were found for them.

        Rows of several final ones were read where the vessel was measured.
        """
        s = self.signature.state_delays
        for at, update in enumerate(self._updates[:count], start=self._pending):
            measured = self._y[at]
            predicted = self.signature.state_scale.centre
            if at >= self._begins:
                if not is_final:
                    self._place(at - 1)
                predicted = self._predicted(history, at - 1)
            innovation = measured - predicted
            history[:-1] = history[1:]
            if update is None:
                history[-1] = measured
            else:
                history[-1] = predicted
                seen = np.isfinite(innovation)
                history += (update.gain @ np.where(seen, innovation, 0.0)).reshape(history.shape)
                exact = np.isfinite(measured) & (self._noise == 0)
                history[-1][exact] = measured[exact]
            rows = self._x[max(at - s, 0) : at + 1]
            rows[:] = history[len(history) - len(rows) :]
            if is_final:
                self._judge(at, update, innovation)

    def _place(self, at: int) -> None:
        """Read the waves of the sample `at` where the estimates up to it place the vessel."""
        if self._follows is None:
            return
        place, (first, table) = self._follows.place, self._table
        surge = self._x[at + 1 - place.taps.size : at + 1, self._follows.column]
        (here,) = place.of(surge).tolist()
        on_grid = min((here - place.lowest) / place.spacing, place.highest)
        read_row(table[at - first], 0, on_grid, self._delayed[at])
        self._direct[at, -1] = (here - place.centre) ** 2

    def _predicted(self, history: FloatArray, at: int) -> FloatArray:
        """One-step prediction from the sample `at`."""
        delayed = self._delayed[at - self.signature.input_delays : at + 1]
        out: FloatArray = self._a @ history.ravel() + self._offset + self._b @ delayed.ravel()
        return out + self._d @ self._direct[at]

    def _judge(self, at: int, update: _Update | None, innovation: FloatArray) -> None:
        """Take a sample into the running squares, NaN for what was not measured."""
        # What filled lost waves drives no free run; without any, the old ones are forgotten.
        read = self._lost[max(at - self._begins, 0) : at + self._ahead]
        is_driven = not read[:, self._waves].any()
        self._innovation, lead = innovation, self._count.lead * is_driven
        measured = self._y[at]
        squares = np.full((2, measured.size), np.nan)
        with undefined():
            if is_driven or at >= 2 * self._begins:  # before, waves are filled from few
                squares[0] = (innovation / (update.deviations if update else self._deviations)) ** 2
            if lead:
                predicted = self._predicted(self._free, at - 1)
                self._free[:-1], self._free[-1] = self._free[1:], predicted
                squares[1] = ((measured - predicted) / self.errors.at(lead)) ** 2
                lead = (lead + 1) % (self.errors.longest + 1)
        if not is_driven:
            squares[1] = ratio(*self._squares[[1, 1], 1])
        squares = np.minimum(squares, SPIKE)
        self._apart[at] = squares.ravel()
        grown = self._fade * self._squares + [squares, np.ones_like(squares)]
        self._squares = np.where(np.isnan(squares), self._squares, grown)
        if not lead and is_driven and (update is None or self._noise.any()):
            self._free[:], lead = self._history, 1
        self._count.lead = lead

    def _find_rows(self, stop: int, known: FloatArray) -> None:
        """Regressors of the samples up to before `stop`; `known` ends with inputs to come."""
        signature, begins, follows = self.signature, self._begins, self._follows
        first = self._pending - 1
        if first < begins:  # no row was wanted yet
            first = begins - 1 - signature.input_delays
        surge = None if follows is None else self._x[self._kept, follows.column]
        # Direct regressors are wanted from the first prediction on.
        drive = signature.input_map.drive(
            known,
            [Span(first, max(first, begins - 1), stop)],
            run=self._own_rig,
            first=self._kept.start,
            surge=surge,
        )
        table = None if follows is None else drive.table(first, stop)
        self._table = first, table
        self._delayed[first:stop], self._direct[first:stop] = drive.rows(first, stop, table)

    @one_blas_thread()
    def forecast(
        self,
        steps: int,
        future: npt.ArrayLike | Mapping[str, npt.ArrayLike] | None = None,
        *,
        level: float = 0.95,
    ) -> xr.Dataset:
        """Forecast from the estimate of the last sample on.

        Parameters
        ----------
        steps : int
            Number of instants.
        future : array_like, shape (rows, Q), or mapping of names to arrays, optional
            Inputs at the instants after :attr:`time`, as far as they are known: NaN, or left out
            of a mapping, where they are not. Where waves end before ``steps − 1 + lead_samples``
            rows, they are predicted from the record, and from what probes up-wave have seen where
            positions and depth are known (`like`, or the model's alignment); departures from
            the prediction widen the band. Where the last samples hold no wave at all, they are
            predicted from those before, whatever is given here.
        level : float, optional
            Probability of the band.

        Returns
        -------
        Dataset
            States with dimensions (statistic, time): ``mean``, ``std``, ``lower``, ``upper``.
            Each channel's ``attrs["lead_time"]`` is the time after :attr:`time` up to which its
            ``std`` stays below half of its SD in training, s; where it is as long as
            the forecast, it is at least that. ``std`` holds the errors of free runs in training,
            those of the estimate, the spread of the members and that of the waves that are not
            known. Where waves are predicted, the mean tends to that of training as ``std`` comes
            near the SD there, and ``std`` to that, so that no lead errs more than the mean. Where
            waves, means of inputs or mean surge of late lie outside the training, the errors are
            raised to those of late and by the square of the height; so are they where a plan goes
            farther than the input did in training. Where the consistency of a state exceeds two,
            its errors are raised by it, and its lead time shrinks; but not above those of free runs
            of late, or what the channel and its forecast depart from the mean of training by
            (at least the SD there). ``attrs["validity"]`` names what
            lies outside (:class:`seakeep.models.validity.Validity`), beside the numbers and
            ``trained_`` ones;
            ``attrs["consistency"]`` is the larger one of each state, at least one.
            ``attrs["predictable"]`` is the time for which the waves at the probe farthest down-wave
            are known from the one farthest up-wave, s
            (:func:`seakeep.signals.prediction.predictable_time`); 0 without positions and depth.

        Raises
        ------
        RequestError
            If there is too little history yet, or an argument does not fit.
        """
        signature, count = self.signature, whole_number(steps, "steps")
        scale = signature.state_scale
        level = fraction(level, "level")
        if (missing := self._begins - self._count.taken) > 0:
            raise RequestError(
                f"there are {self._count.taken} samples of history and the model needs "
                f"{self._begins}. Call step {missing} more times first."
            )
        closed = self._closed()
        futures, freedom, known = self._futures(count, future, closed)
        # In the dark the errors of what was filled grow as those of what is to come.
        leads, unseen = self.errors.longest, min(closed.dark, self._count.unseen)
        dark = min(unseen, leads, self._count.taken - self._begins)
        taken = self._count.taken - dark
        history = self._x[taken - signature.state_samples : taken]
        back = signature.input_history + 1 + dark
        windows = engine.array_windows(
            signature,
            np.broadcast_to(history, (len(futures), *history.shape)),
            futures[:, min(self._count.taken, self._record) - back :],
            dark + count,
            self._own_rig,
        )
        ((values, lost),) = engine.member_series(self.model, [windows])
        complete = values[lost.max(axis=1) < 0]
        conditions, (late, free) = self.conditions, np.fmax(self.consistency_by_state, 1.0)
        validity, coverage = self._validity(conditions, closed), self.model.coverage
        plan = futures[0, len(closed.record) :]
        beyond = np.delete((plan < coverage.least) | (plan > coverage.most), self._waves, axis=1)
        if beyond.any():
            validity |= Validity.MEAN
        worst = np.maximum(late, free)
        wider = np.where(worst > ALARM, worst, 1.0)
        if conditions is not None and (conditions.validity or beyond.any()):
            wider = np.maximum(np.maximum(wider, free), conditions.beyond**2)
        table = np.full((4, count, len(signature.states)), np.nan)
        if len(complete):
            # Errors of the model and of the estimate, never above those of the open loop.
            errors = self.errors.of_forecast(count, self._count.since)
            if self._count.partly:
                own = self.errors.of_forecast(count)
                errors = np.minimum(own + self._filter.ahead(count, self._raised), errors)
            given = np.arange(count) <= known - self._ahead
            before = departure(history, scale)
            table[0], spread, weight = weighed(complete, errors, scale, given, before)
            if unseen > leads:
                table[0], weight = scale.centre, np.zeros_like(weight)
            # Not above those of free runs of late, or what channel and forecast depart by.
            usual = scale.spread**2
            own = np.mean((self._x[self._kept] - scale.centre) ** 2, axis=0)
            usual = np.minimum(wider * usual, np.maximum(usual, own))
            most = np.maximum(free * errors, usual + (table[0] - scale.centre) ** 2)
            # The error passes over with the mean, to that of the mean of training.
            variance = weight * (spread + np.minimum(wider * errors, most))
            table[1] = np.sqrt(variance + (1.0 - weight) * usual)
            spread *= weight
            half = _quantile(level, spread, table[1] ** 2, freedom) * table[1]
            table[2:] = table[0] - half, table[0] + half
        variables = label_channels(signature, table, ("statistic", "time"))
        inside = table[1] <= SMALL * scale.spread
        for label, samples in zip(signature.state_labels, held_samples(inside), strict=True):
            variables[label.name][2]["lead_time"] = int(samples) * signature.dt
        time = self._time + signature.dt * np.arange(1, count + 1)
        attrs = {
            "start": self._time,
            "level": level,
            "known_input": max(known, 0),
            "diverged": len(values) - len(complete),
            "predictable": self._predictable(),
            "validity": validity.words,
            **({} if conditions is None else conditions.attrs()),
            "consistency": worst,
        }
        return xr.Dataset(
            variables,
            coords={
                "statistic": statistic_coordinate(
                    level, "the mean minus and plus a quantile times std"
                ),
                "time": ("time", time, {"units": "s", "long_name": "time"}),
            },
            attrs=attrs,
        )

    def _predictable(self) -> float:
        """Time for which the waves at the last probe are known from the first one, s."""
        if np.isnan(self._places).all():
            return 0.0
        record = self._known_inputs()[:, self._waves[np.nanargmin(self._places)]]
        if not np.ptp(record) > 0:
            return 0.0
        apart = float(np.nanmax(self._places) - np.nanmin(self._places))
        return predictable_time(record, self.signature.dt, apart, self._depth)

    def _futures(self, steps: int, future: Any, closed: _Closed) -> tuple[FloatArray, float, int]:
        """Inputs of the record and after it, shape (1 + 2 departures, time, Q).

        First those that are expected, then departures from them and their opposites, of each wave
        by an innovation where it is first not known; the degrees of freedom of these; and how many
        rows were given, below zero where the last ones of the record were lost.
        """
        names, waves, (record, gone, tail) = self.signature.inputs, self._waves, closed
        dark, light = min(tail, self.errors.longest), len(record) - tail
        wanted = steps - 1 + self._ahead
        # What filled a gap that is not closed does not join the waves after it.
        before = np.flatnonzero(gone[:light].all(axis=1)).max(initial=-1) + 1
        before *= bool(waves) and light - before >= AFTER
        inputs, begin = np.concatenate([record, _plan(future, names, wanted)]), len(record)
        for name, role in self._roles.items():
            own = inputs[begin - 1 :, names.index(name)]
            known = np.isfinite(own[1:]).sum()
            if role == "known" and known < wanted:
                raise RequestError(
                    f"'{name}' is a known input, and future gives {known} of the {wanted} samples "
                    f"that {steps} steps need. Give its plan: future = {{'{name}': …}}, or the "
                    "role 'constant'."
                )
            own[:] = pd.Series(own).ffill()
        inputs[begin - dark : begin, waves] = np.nan
        if not np.isnan(inputs).any():
            return inputs[None], math.inf, wanted
        filled, first, freedom = fill_future(
            inputs[:, waves],
            begin - dark,
            lambda of, steps: self._foreseen(of[max(before, len(of) - self._record) :], steps),
        )
        futures = np.repeat(inputs[None], len(filled), axis=0)
        futures[:, :, waves] = filled
        return futures, freedom, first - begin

    def save(self, path: str | Path) -> Path:
        """Write all that the object needs to go on (NetCDF), to a temporary name first.

        Parameters
        ----------
        path : str or Path
            File; an earlier state there is replaced.

        Returns
        -------
        Path
            The file; :func:`seakeep.load_live` goes on from it as if nothing had happened.

        Raises
        ------
        RequestError
            If the file cannot be written, or another one is there.
        """
        words = {
            "counts": asdict(self._count),
            "as_it_is": [each is None for each in self._updates],
            "time": self._time,
            "rig": [self._rig.attrs, {name: each.attrs for name, each in self._rig.items()}],
            "noise": self._stated,
            "roles": self._roles,
        }
        state = xr.Dataset(
            {"values": ("number", np.concatenate([each.ravel() for each in self._parts()]))},
            attrs={"settings": json.dumps(words), "model": self._identity},
        )
        return write_sealed(state, path, STATE)

    def _parts(self) -> list[FloatArray]:
        """Views of all that samples and forecasts to come read."""
        parts = [rows[self._kept] for rows in (self._u, self._lost, self._x)]
        # Of regressors those that the next prediction reads; it finds the last row, and its direct
        # ones, again.
        first = max(self._pending - 1 - self.signature.input_delays, 0)
        parts += [rows[first : self._count.taken] for rows in (self._y, self._delayed)]
        parts.append(self._of_late)
        parts += [each for update in self._updates if update for each in update]
        parts += [self._history, self._free, self._innovation, self._squares, self._jumps.memory]
        if self._count.since:  # or it is zero
            parts.append(self._filter.covariance)
        return parts

    @cached_property
    def _identity(self) -> str:
        """Identity of the model."""
        digest = hashlib.sha256(json.dumps(plain(asdict(self.signature))).encode())
        for each in (self._a, self._b, self._d, self._offset):
            digest.update(np.ascontiguousarray(each).tobytes())
        return digest.hexdigest()

    def _restore(self, content: Mapping[str, Any], values: FloatArray) -> None:
        """Restore what :meth:`save` wrote."""
        self._count, self._time = _Counts(**content["counts"]), content["time"]
        self._count.taken = min(self._count.taken, self._record)
        size, count = self._history.size, len(self.signature.states)
        self._updates = [
            None if as_it_is else _Update(np.empty((size, count)), np.empty(count))
            for as_it_is in content["as_it_is"]
        ]
        for part in self._parts():
            part.flat[:], values = np.split(values, [part.size])


def load_live(model: Servable, path: str | Path) -> Live:
    """Continue from a state that :meth:`Live.save` wrote, as if the process had never stopped.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        The model that was in service.
    path : str or Path
        The file.

    Returns
    -------
    Live
        Equal to the last bit; no code from the file is run.

    Raises
    ------
    RequestError
        If there is no such file, or it belongs to another model.
    DataError
        If it is damaged.
    """
    dataset = load_sealed(path, STATE)
    content = store.content(dataset, "settings")
    attrs, probes = content["rig"]
    like = xr.Dataset({name: ((), 0.0, each) for name, each in probes.items()}, attrs=attrs)
    live = model.live(like=like, noise=content["noise"], roles=content["roles"])
    if dataset.attrs["model"] != live._identity:
        raise RequestError(
            f"{path} is the state of another model. Load the model that was in service, or start "
            "anew with model.live()."
        )
    live._restore(content, dataset["values"].values)
    return live


def held_samples(inside: BoolArray) -> IntArray:
    """Leads that are all `inside` from the first on: how many of (steps, N), shape (N,)."""
    return np.logical_and.accumulate(inside).sum(axis=0)


def _quantile(level: float, spread: FloatArray, variance: FloatArray, freedom: float) -> FloatArray:
    """Half-width of the band in standard deviations: Student's quantile.

    Part of the variance is the `spread`, which is known with some degrees of `freedom`, and the
    rest is known from free runs; those of the sum are Satterthwaite's (1946).
    """
    share = spread / np.maximum(variance, TINY)
    doubt = (1.0 - share) ** 2 / WINDOWS + share**2 / freedom
    return special.stdtrit(1.0 / np.maximum(doubt, 1e-6), 0.5 + 0.5 * level)


def _mean_predictor(
    members: Sequence[Dynamics], signature: Signature
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Mean of the members' one-step predictions: x' = offset + a x̂ + b û + d v.

    Physical units; blocks of a and b are oldest first.
    """

    def groups(of: Signature) -> Iterator[tuple[int, Scale]]:
        return zip((of.state_delays, of.input_delays, 0), of.scales, strict=True)

    count = len(signature.states)  # newest first, as members have them
    out = [np.zeros((count, delays + 1, of.mean.size)) for delays, of in groups(signature)]
    offset = np.zeros(count)
    for member in members:
        own, first = member.signature.state_scale, 0
        offset += own.mean
        for whole, (delays, of) in zip(out, groups(member.signature), strict=True):
            stop = first + (delays + 1) * of.mean.size
            columns = member.coefficients[:count, first:stop].reshape(count, delays + 1, -1)
            physical = columns * own.std[:, None, None] / of.std
            offset -= np.einsum("nlc,c->n", physical, of.mean)
            whole[:, : delays + 1] += physical
            first = stop
    a, b, d = (each[:, ::-1].reshape(count, -1) / len(members) for each in out)
    return offset / len(members), a, b, d


def _rig(signature: Signature, like: xr.Dataset | None) -> xr.Dataset:
    """Attributes of a run that an alignment reads, as those of a run without samples."""
    rig = xr.Dataset({each: ("time", np.zeros(0)) for each in signature.inputs})
    if like is None:
        return rig
    rig.attrs = {key: float(like.attrs[key]) for key in RIG if key in like.attrs}
    for name in signature.inputs:
        if name in like and "x_position" in like[name].attrs:
            rig[name].attrs["x_position"] = float(like[name].attrs["x_position"])
    return rig


def _named(what: str, given: object, names: Sequence[str]) -> Mapping[str, Any]:
    """A mapping of some names, none of which is unknown."""
    table = {} if given is None else as_table(given, what)
    for name in table:
        if name not in names:
            raise RequestError(
                f"{what} names '{name}', which the model does not know."
                f"{did_you_mean(str(name), names)} It takes: {', '.join(names) or 'none'}."
            )
    return table


def _noise(signature: Signature, noise: Mapping[str, float] | None) -> dict[str, float]:
    """Standard deviations of the measurement noise that is stated."""
    given = _named("noise", noise, signature.states)
    return {
        label.name: positive(given[label.name], f"noise of {label.name}", label.units)
        for label in signature.state_labels
        if label.name in given
    }


def _roles(signature: Signature, roles: Mapping[str, str] | None) -> dict[str, str]:
    """Roles of the inputs that are no waves."""
    given = _named("roles", roles, signature.inputs)
    for name, role in given.items():
        check_choice(f"role of {name}", role, ("wave", "known", "constant"))
    return {name: role for name, role in given.items() if role != "wave"}


def _plan(future: Any, names: Sequence[str], count: int) -> FloatArray:
    """Rows of inputs to come, shape (count, Q), NaN where they are not given."""
    out = np.full((count, len(names)), np.nan)
    if isinstance(future, Mapping):
        for name, values in _named("future", future, names).items():
            given = as_real(values, f"future of {name}").ravel()[:count]
            out[: len(given), names.index(name)] = given
    elif future is not None and np.size(future):
        given = rows_by_name("future", future, 0, names, "any number")[:count]
        out[: len(given)] = given
    if np.isinf(out).any():
        raise RequestError("future holds an infinite value. Give NaN for what is not known.")
    return out


def _sample(name: str, value: object, names: Sequence[str]) -> FloatArray:
    """One sample in the order of the model, NaN for what is missing."""
    if value is None or isinstance(value, Mapping):
        given = _named(name, value, names)
        value = [given.get(each, math.nan) for each in names]
    array = as_real(value, name)
    if array.shape != (len(names),):
        raise RequestError(
            f"{name} has shape {array.shape}; one number for each of {', '.join(names) or 'none'} "
            f"is needed: shape ({len(names)},)."
        )
    if np.any(np.isinf(array)):
        raise RequestError(f"{name} holds an infinite value. Give NaN for what was not measured.")
    return array.copy()
