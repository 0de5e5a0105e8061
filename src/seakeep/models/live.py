"""A model in service: samples arrive one at a time, some are lost, future waves are not known.

:class:`Live` follows a vessel sample by sample. A Kalman filter on the delayed states fills what
was not measured (:mod:`seakeep.core.kalman`); a forecast starts from its estimate, as
:meth:`HankelDMDcModel.forecast` starts from a measured history.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy import special

from seakeep.arrays import (
    BoolArray,
    FloatArray,
    as_real,
    as_table,
    fraction,
    positive,
    whole_number,
)
from seakeep.core.kalman import DelayFilter, process_noise
from seakeep.core.recursion import read_table
from seakeep.errors import RequestError, did_you_mean
from seakeep.files import load_sealed, write_sealed_array
from seakeep.models import engine, store
from seakeep.models.engine import Dynamics, Windows
from seakeep.models.executor import one_blas_thread
from seakeep.models.following import Followed, Following
from seakeep.models.forecasts import label_channels, rows_by_name
from seakeep.models.growth import WINDOWS, LeadErrors
from seakeep.models.inputs import Chain, FittedAlignment, Measured
from seakeep.models.interface import Regressors, Signature, Span
from seakeep.models.summaries import statistic_coordinate
from seakeep.signals.prediction import draw_sea, predict_waves, predictable_time

__all__ = ["Live", "load_live"]

STATE = "live state"
"""Kind of the files of :meth:`Live.save`."""
PAIRS = 8
"""Pairs of futures of the waves that are drawn where they are not known."""
RECORD = 16
"""Record that is kept, in longest delays: what waves are predicted from."""
LEAST_RECORD = 512
"""Samples of record that are kept at least."""
CONSISTENCY = 256
"""Samples over which the consistency is averaged, as a time constant; twice as many as a free run
lasts, at least, where it is that of free runs."""
SPIKE = 100.0
"""What a single sample adds to the consistency at most: a spike tells of a sensor, for a while."""
RIG = ("water_depth", "celerity", "probe_offset")
"""Attributes of a run that an alignment reads."""


class Servable(Protocol):
    """A model that can go into service."""

    @property
    def signature(self) -> Signature: ...
    @property
    def n_members(self) -> int: ...
    def free_runs(self, groups: Sequence[Windows], members: Sequence[int]) -> list[FloatArray]:
        """Free runs of members over groups of windows."""
        ...

    def live(
        self, *, like: xr.Dataset | None = None, noise: Mapping[str, float] | None = None
    ) -> Live:
        """Put the model into service."""
        ...


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

    Raises
    ------
    RequestError
        If the model holds no errors, or a noise is out of range.
    """

    def __init__(
        self,
        model: Servable,
        members: Sequence[Dynamics],
        errors: LeadErrors | None,
        *,
        like: xr.Dataset | None = None,
        noise: Mapping[str, float] | None = None,
    ) -> None:
        if errors is None:
            raise RequestError(
                "the model holds no errors of its training, from which a live model takes its "
                "noises: it is a member of an ensemble, which keeps them for all of its members. "
                "Use ensemble.hold().live()."
            )
        self.model, self.signature, self.errors = model, model.signature, errors
        signature = self.signature
        self._rig = _rig(signature, like)
        self._noise = _noise(signature, noise)
        chain = Chain.of(signature.input_map)
        self._follows = signature.input_map.follows
        rig = _dataset(signature, self._rig)
        aligned = chain.alignment
        if aligned is not None and self._follows is None and aligned.carries_in(rig):
            raise RequestError(
                "the model is driven by waves that are carried over whole records, which are not "
                "there in service. Fit it with alignment mode = 'dispersion', surge = 'predicted', "
                "which carries them in each step, or without alignment."
            )
        self._places, self._depth = _places(signature, chain.alignment, self._rig)
        self._offset, self._a, self._b, self._d = _mean_predictor(members, signature)
        count, s = len(signature.states), signature.state_delays
        size, variances = count * (s + 1), self._noise**2
        process = process_noise(errors.residual, self._a, variances)
        self._filter = DelayFilter(self._a, process, variances, np.zeros((size, size)))
        self._whitening_known = np.linalg.inv(np.linalg.cholesky(process))
        self._deviation_known = np.sqrt(np.diagonal(process) + variances)
        # Samples after an instant whose input is needed before its estimate is final.
        self._time = math.nan
        self._ahead = signature.lead_samples
        # Of a model that follows its own surge: the map with its carriers in this rig, and filters
        # that predict the probes from one another; rows at all places of the samples to come.
        self._following = next((each for each in chain.maps if isinstance(each, Following)), None)
        self._table = (0, np.empty(0))
        if self._following is not None:
            self._banks = self._following.banks(rig)
            self._foresight = self._following.foresight(rig, max(self._ahead, 1))
        longest = max(s, signature.input_delays) + 1
        needed = 2 * (signature.history_samples + self._ahead + 1)
        self._record = max(LEAST_RECORD, needed, RECORD * longest)
        delayed, direct = signature.input_scale.mean.size, signature.direct_scale.mean.size
        widths = {"u": len(signature.inputs), "x": count, "y": count}
        widths |= {"delayed": delayed, "direct": direct}
        room = 2 * self._record
        self._kept = {name: np.full((room, width), np.nan) for name, width in widths.items()}
        slots = self._ahead + 2
        self._gains = np.zeros((slots, size, count))
        self._whitenings = np.zeros((slots, count, count))
        self._deviations = np.zeros((slots, count))
        self._plain = np.zeros(slots, dtype=bool)
        self._history = np.tile(signature.state_scale.centre, (s + 1, 1))
        self._innovation = np.full(count, np.nan)
        # Of squares that fade: sums, and weights; of all states, of each, and of each in free runs.
        self._squares = np.zeros((2, 2 * count + 1))
        self._fade = np.full(2 * count + 1, 1.0 - 1.0 / CONSISTENCY)
        self._fade[count + 1 :] = 1.0 - 1.0 / max(CONSISTENCY, 2 * len(errors.rms))
        self._free = self._history.copy()
        # Places in the record (how much of it is filled, the last final estimate, the first row of
        # regressors that is not, the first sample that is predicted), then counts of samples: all,
        # those since the whole history was measured and whether anything was seen since then,
        # complete ones in a row, and those since the start of a free run.
        self._at = {
            "filled": 0,
            "final": -1,
            "rows": signature.history_samples - 1 - signature.input_delays,
            "begins": signature.history_samples,
            "taken": 0,
            "since": 0,
            "partly": 1,
            "complete": 0,
            "lead": 0,
        }

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
        return self._at["filled"] >= self.signature.history_samples

    @property
    def state(self) -> FloatArray:
        """Estimate of the states at :attr:`time`, shape (N,), physical units."""
        state: FloatArray = self._x[self._last].copy()
        return state

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the errors of :attr:`state`, shape (N, N)."""
        count = len(self.signature.states)
        return self._filter.covariance[-count:, -count:].copy()

    @property
    def innovation(self) -> FloatArray:
        """Measurement minus one-step prediction, shape (N,), NaN for what was not measured.

        It belongs to the last instant whose prediction reads no wave that is still to come: the
        last sample, or with a look-ahead of l samples that of l − 1 samples before.
        """
        return self._innovation.copy()

    @property
    def consistency(self) -> float:
        """Running mean of the normalised innovation squared, per measured state.

        One where the innovations are as large as the residuals of training, over the last few
        hundred samples. Well above one for longer than that, the model no longer fits the vessel,
        or a sensor its channel; NaN before the first prediction.
        """
        return float(self._mean_squares()[0])

    @property
    def consistency_by_state(self) -> FloatArray:
        """The same for each state, shape (2, N): one step ahead, and in free runs.

        Free runs start again and again from the estimate, are driven by the waves as they were
        measured, and last as long as those of training, whose errors at each lead they are compared
        with. A small error of each step that is always the same, as in waves outside the training,
        shows in the second row long before the first. NaN where there is none yet.
        """
        return self._mean_squares()[1:].reshape(2, -1)

    def _mean_squares(self) -> FloatArray:
        with np.errstate(invalid="ignore"):  # 0/0 before the first
            found: FloatArray = self._squares[0] / self._squares[1]
        return found

    @property
    def equations(self) -> dict[str, Any]:
        """What the filter computes with, for hosts: x' = offset + a x̂ + b û, blocks oldest first.

        Variances of process and measurement noise, mean and spread of the states, errors of free
        runs by lead, and the samples of input that waves to come are predicted from.
        """
        scale, noises = self.signature.state_scale, {"process": self._filter.process}
        noises |= {"noise": self._filter.noise, "errors": self.errors.rms}
        moments = {"centre": scale.centre, "spread": scale.spread, "record": self._record}
        return {"a": self._a, "b": self._b, "offset": self._offset} | noises | moments

    @property
    def _last(self) -> int:
        return self._at["filled"] - 1

    @property
    def _x(self) -> FloatArray:
        return self._kept["x"]

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
            Instant of the sample, s, to check that none was left out. By default one step after
            the last; the first is 0.

        Returns
        -------
        ndarray, shape (N,)
            :attr:`state`.

        Raises
        ------
        RequestError
            If a length, a name or the time does not fit, or a value is infinite. Nothing has
            changed then, and the same sample can be given again.
        """
        signature = self.signature
        instant = self._instant(time)
        states, inputs = _sample("y", y, signature.states), self._inputs(u)
        self._make_room()
        at = self._at["filled"]
        self._kept["u"][at], self._kept["y"][at] = inputs, states
        # Held until it is estimated: an alignment reads where the vessel is.
        self._x[at] = np.where(np.isfinite(states), states, self._x[at - 1])
        self._at["filled"] += 1
        self._at["taken"] += 1
        self._time = instant
        self._filtered(at, np.isfinite(states))
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
                f"time = {instant:g} s is not after the last sample at {self._time:g} s. Samples "
                "must come in the order of their instants, each once."
            )
        raise RequestError(
            f"time = {instant:g} s is {instant - self._time:g} s after the last sample, and the "
            f"model steps by {dt:g} s. Call step() without arguments once for each sample that "
            "was lost; resample the rest to the model's step."
        )

    def _inputs(self, u: npt.ArrayLike | Mapping[str, float] | None) -> FloatArray:
        inputs = _sample("u", u, self.signature.inputs)
        lost = np.isnan(inputs)
        if lost.any():
            if (filled := self._at["filled"]) < 4:
                raise RequestError(
                    f"inputs that are missing are predicted from the samples before, and there are "
                    f"{filled}. Start with at least 4 samples of all of u."
                )
            inputs[lost] = self._foreseen()[lost]
        return inputs

    def _foreseen(self) -> FloatArray:
        """Inputs of a sample that was lost: from each record, and from the probe up-wave."""
        known, placed = self._known_inputs(), np.count_nonzero(np.isfinite(self._places))
        if self._following is not None and self.ready:
            first: FloatArray = self._expected(known, 1)[0]
            return first
        expected: FloatArray
        if placed < 2 or not self.ready:
            expected = predict_waves(known, 1)[0]
            return expected
        rng, dt = np.random.default_rng(0), self.signature.dt
        pair = draw_sea(known, 1, 1, rng, dt=dt, positions=self._places, depth=self._depth)
        expected = pair.mean(axis=0)[0]  # the draws lie about it
        return expected

    def _expected(self, known: FloatArray, count: int) -> FloatArray:
        """Inputs of the next samples: in waves as those of training, or from each record."""
        if self._following is None or not self.ready:
            return predict_waves(known, count)
        taps, placed = self._foresight
        means = self.signature.input_scale.mean[: known.shape[1]]
        out = np.repeat(known[-1:], count, axis=0)
        last = known[len(known) - taps.shape[3] :, placed] - means[list(placed)]
        out[:, placed] = np.einsum("cqpt,tp->cq", taps[:count], last) + means[list(placed)]
        others = [each for each in range(known.shape[1]) if each not in placed]
        if others:
            out[:, others] = predict_waves(known[:, others], count)
        return out

    def _known_inputs(self) -> FloatArray:
        """Inputs that waves are predicted from: the last ones, always as many once there are."""
        filled = self._at["filled"]
        return self._kept["u"][max(filled - self._record, 0) : filled]

    def _make_room(self) -> None:
        """Move what is kept to the front where the room is used up."""
        if self._at["filled"] < 2 * self._record:
            return
        for values in self._kept.values():
            values[: self._record] = values[self._record :]
        for place in ("filled", "final", "rows", "begins"):
            self._at[place] -= self._record

    def _filtered(self, at: int, seen: BoolArray) -> None:
        """Covariance and gain of the sample, then the means that its input completes."""
        place = self._at
        slot = place["taken"] % len(self._gains)
        is_exact = bool(seen.all()) and not self._noise.any()
        plain = is_exact and place["since"] == 0 and at >= place["begins"]
        self._plain[slot] = plain
        if not plain:
            self._update(at, seen, slot)
        place["complete"] = place["complete"] + 1 if is_exact else 0
        if place["complete"] > self.signature.state_delays:
            place["since"] = place["partly"] = 0
            self._filter.covariance.fill(0.0)
        elif not plain:
            place["since"] += 1
            place["partly"] |= int(seen.any())
        self._settle(at)

    def _update(self, at: int, seen: BoolArray, slot: int) -> None:
        if at < self._at["begins"]:
            self._filter.shift(np.diag(self.signature.state_scale.spread**2))
        else:
            self._filter.shift()
            limit = self.errors.at(self._at["since"] + 1) ** 2
            blind = not (self._at["partly"] or seen.any())
            self._filter.limit(limit, exactly=blind)
        self._deviations[slot] = np.sqrt(np.diagonal(self.covariance) + self._noise**2)
        self._gains[slot], self._whitenings[slot] = self._filter.measure(seen)

    def _settle(self, at: int) -> None:
        """Bring estimates up to the sample `at`: final ones, then those that waves to come move."""
        place = self._at
        if at < place["begins"]:
            self._advance(self._history, at, at)
            place["final"] = at
            return
        final = at - max(self._ahead - 1, 0)
        if final > place["final"]:
            self._find_rows(final, self._known_inputs())
            place["rows"] = final
            self._advance(self._history, place["final"] + 1, final, is_final=True)
            place["final"] = final
        if place["final"] == at:
            return
        slots = (place["taken"] - np.arange(at - place["final"])) % len(self._plain)
        if self._plain[slots].all():
            self._x[at] = self._kept["y"][at]
            return
        known = self._known_inputs()
        if self._ahead and self.signature.inputs:
            known = np.concatenate([known, self._expected(known, self._ahead)])
        self._find_rows(at, known)
        self._advance(self._history.copy(), place["final"] + 1, at)

    def _advance(
        self, history: FloatArray, first: int, last: int, *, is_final: bool = False
    ) -> None:
        """Run the mean through samples, with the gains that were found for them."""
        place, s = self._at, self.signature.state_delays
        for at in range(first, last + 1):
            slot = (place["taken"] - (self._last - at)) % len(self._gains)
            measured = self._kept["y"][at]
            predicted = self.signature.state_scale.centre
            if at >= place["begins"]:
                predicted = self._predicted(history, at - 1)
            innovation = measured - predicted
            history[:-1] = history[1:]
            if self._plain[slot]:
                history[-1] = measured
            else:
                history[-1] = predicted
                told = np.where(np.isfinite(innovation), innovation, 0.0)
                history += (self._gains[slot] @ told).reshape(history.shape)
                exact = np.isfinite(measured) & (self._noise == 0)
                history[-1][exact] = measured[exact]
            first_kept = max(at - s, 0)
            self._x[first_kept : at + 1] = history[first_kept - at - 1 :]
            if is_final:
                self._judge(at, slot, innovation)

    def _predicted(self, history: FloatArray, at: int) -> FloatArray:
        """One-step prediction from the sample `at`."""
        z, kept = self.signature.input_delays, self._kept
        if self._follows is not None:
            place, column, _ = self._follows
            first, table = self._table
            here = place.of(self._x[at + 1 - place.taps.size : at + 1, column])
            kept["delayed"][at] = read_table(place, table, np.array([at - first]), here)[0]
            kept["direct"][at, -1] = place.squared(here)[0]
        out = self._a @ history.ravel()
        out += self._offset
        out += self._b @ kept["delayed"][at - z : at + 1].ravel()
        if self._d.size:
            out += self._d @ kept["direct"][at]
        return out

    def _judge(self, at: int, slot: int, innovation: FloatArray) -> None:
        """Take a sample into the running squares, NaN for what was not measured."""
        self._innovation, plain, lead = innovation, self._plain[slot], self._at["lead"]
        measured, seen = self._kept["y"][at], np.isfinite(innovation)
        one, free = np.full(seen.size + 1, np.nan), np.full(seen.size, np.nan)
        with np.errstate(over="ignore", invalid="ignore"):
            if seen.any():
                # A sum of squares: it may overflow, and is never negative.
                whitening = self._whitening_known if plain else self._whitenings[slot]
                white = whitening @ np.where(seen, innovation, 0.0)
                one[0] = np.fmin(np.sum(white**2) / np.count_nonzero(seen), SPIKE)
                deviations = self._deviation_known if plain else self._deviations[slot]
                one[1:] = (innovation / deviations) ** 2
            if lead:
                predicted = self._predicted(self._free, at - 1)
                self._free[:-1], self._free[-1] = self._free[1:], predicted
                free = ((measured - predicted) / self.errors.at(lead)) ** 2
        squares = np.concatenate([one, free])
        taken = ~np.isnan(squares)
        self._squares[:, taken] *= self._fade[taken]
        self._squares[0, taken] += np.minimum(squares[taken], SPIKE)
        self._squares[1, taken] += 1.0
        lead = (lead + 1) % (len(self.errors.rms) + 1) if lead else 0
        if not lead and (plain or self._noise.any()):
            self._free[:], lead = self._history, 1
        self._at["lead"] = lead

    def _find_rows(self, stop: int, known: FloatArray) -> None:
        """Regressors of the samples up to before `stop`; `known` ends with inputs to come."""
        first, signature = self._at["rows"], self.signature
        if stop <= first:
            return
        begin = self._at["filled"] - min(self._at["filled"], self._record)
        if self._following is not None and self._follows is not None:
            surge = self._x[begin : self._at["filled"], self._follows.column]
            drive = Followed(self._following, Measured(known, begin, surge), self._banks)
            places = drive.places(first, stop)
            self._table = (first, drive.table(first, stop))
            self._kept["delayed"][first:stop] = read_table(
                self._follows.place, self._table[1], np.arange(stop - first), places
            )
            self._kept["direct"][first:stop, :-1] = drive.direct(first, stop)
            return
        # Direct regressors are wanted from the first prediction on.
        span = Span(first, max(first, self._at["begins"] - 1), stop)
        wrapped = signature.input_map.wrap(Measured(known, begin), None, [span])
        found: Regressors = wrapped.rows(first, stop)
        self._kept["delayed"][first:stop] = found.delayed
        self._kept["direct"][first:stop] = found.direct

    @one_blas_thread()
    def forecast(
        self,
        steps: int,
        future: npt.ArrayLike | None = None,
        *,
        level: float = 0.95,
        share: float = 0.5,
    ) -> xr.Dataset:
        """Forecast from the estimate of the last sample on.

        Parameters
        ----------
        steps : int
            Number of instants.
        future : array_like, shape (rows, Q), optional
            Inputs at the instants after :attr:`time`, if they are known; columns with names are
            taken by name. Where they end before ``steps − 1 + lead_samples`` rows, the waves are
            predicted from the record, and from what probes up-wave have seen where positions and
            depth are known (`like`, or the model's alignment); futures drawn about the prediction
            widen the band.
        level : float, optional
            Probability of the band.
        share : float, optional
            Part of the training SD below which the error is to stay over the lead time.

        Returns
        -------
        Dataset
            States with dimensions (statistic, time): ``mean``, ``std``, ``lower``, ``upper``.
            Each channel's ``attrs["lead_time"]`` is the time after :attr:`time` up to which its
            ``std`` stays below ``attrs["share"]`` of its SD in training, s; where it is as long as
            the forecast, it is at least that. ``std`` holds the errors of free runs in training,
            those of the estimate, the spread of the members and that of the waves that are not
            known. ``attrs["predictable"]`` is the time for which
            the waves at the probe farthest down-wave are known from the one farthest up-wave, s
            (:func:`seakeep.signals.prediction.predictable_time`); 0 without positions and depth.

        Raises
        ------
        RequestError
            If there is too little history yet, or an argument does not fit.
        """
        signature, count = self.signature, whole_number(steps, "steps")
        level, share = fraction(level, "level"), positive(share, "share", "training SD")
        if not self.ready:
            raise RequestError(
                f"there are {self._at['filled']} samples of history and the model needs "
                f"{signature.history_samples}. Call step {self._missing()} more times first."
            )
        futures, known = self._futures(count, future)
        windows = self._windows(count, futures)
        values = self.model.free_runs([windows], range(self.model.n_members))[0]
        kept = values[engine.first_lost(values).max(axis=1) < 0].reshape(-1, *values.shape[2:])
        table = np.full((4, count, len(signature.states)), np.nan)
        if len(kept):
            spread = kept.var(axis=0, ddof=1) if len(kept) > 1 else np.zeros(table.shape[1:])
            table[0] = kept.mean(axis=0) if len(kept) > 1 else kept[0]
            table[1] = np.sqrt(spread + self._error_variances(count))
            half = _quantile(level, spread, table[1] ** 2, len(futures) > 1) * table[1]
            table[2:] = table[0] - half, table[0] + half
        variables = label_channels(signature, table, ("statistic", "time"))
        inside = table[1] <= share * signature.state_scale.spread
        for label, samples in zip(signature.state_labels, held_samples(inside), strict=True):
            variables[label.name][2]["lead_time"] = int(samples) * signature.dt
        words = "the mean minus and plus a quantile times std"
        time = self._time + signature.dt * np.arange(1, count + 1)
        attrs = {"start": self._time, "level": level, "share": share, "known_input": known}
        attrs |= {"diverged": len(values) - len(kept) // values.shape[1]}
        attrs |= {"predictable": self._predictable()}
        return xr.Dataset(
            variables,
            coords={
                "statistic": statistic_coordinate(level, words),
                "time": ("time", time, {"units": "s", "long_name": "time"}),
            },
            attrs=attrs,
        )

    def _predictable(self) -> float:
        """Time for which the waves at the last probe are known from the first one, s."""
        order = [place for place in np.argsort(self._places) if np.isfinite(self._places[place])]
        if not order or not np.ptp(record := self._known_inputs()[:, order[0]]) > 0:
            return 0.0
        apart = float(np.ptp(self._places[order]))
        return predictable_time(record, self.signature.dt, apart, self._depth)

    def _missing(self) -> int:
        return self.signature.history_samples - self._at["filled"]

    def _futures(self, steps: int, future: npt.ArrayLike | None) -> tuple[list[FloatArray], int]:
        """Inputs of the record and after it, of each future, and how many rows were given."""
        names, record = self.signature.inputs, self._known_inputs()
        if not names:
            return [record], 0
        wanted = steps - 1 + self._ahead
        given = np.zeros((0, len(names)))
        if future is not None and np.size(future):
            given = rows_by_name("future", future, 0, names, "any number")[:wanted]
            if not np.all(np.isfinite(given)):
                raise RequestError(
                    "future holds values that are not finite. End it before the first gap: what "
                    "follows is predicted."
                )
        known = np.concatenate([record, given])
        if len(given) == wanted:
            return [known], len(given)
        rng = np.random.default_rng(self._at["taken"])
        drawn = draw_sea(
            known,
            wanted - len(given),
            PAIRS,
            rng,
            dt=self.signature.dt,
            positions=self._places,
            depth=self._depth,
        )
        return [np.concatenate([known, each]) for each in drawn], len(given)

    def _windows(self, steps: int, futures: Sequence[FloatArray]) -> Windows:
        """What a forecast reads, for each future."""
        signature, filled = self.signature, self._at["filled"]
        history = self._x[filled - signature.state_samples : filled]
        back = signature.input_map.history(signature.input_delays) + 1
        size = min(filled, self._record)
        inputs = np.stack([each[size - back :] for each in futures])
        if not signature.inputs:
            inputs = np.zeros((1, signature.input_delays + steps, 0))
        histories = np.broadcast_to(history, (len(inputs), *history.shape))
        rig = None if self._follows is None else _dataset(signature, self._rig)
        return engine.array_windows(signature, histories, inputs, steps, rig)

    def _error_variances(self, steps: int) -> FloatArray:
        """Variances of the model's errors and the estimate's, never above the open loop's."""
        own = self.errors.of_forecast(steps)
        if not self._filter.covariance.any():
            return own
        bound = self.errors.of_forecast(steps, self._at["since"])
        if not self._at["partly"]:
            return bound
        result: FloatArray = np.minimum(own + self._filter.ahead(steps), bound)
        return result

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
        parts = np.concatenate([each.ravel() for each in self._parts()])
        covariance = self._filter.covariance
        rows = np.flatnonzero(covariance.any(axis=1))
        block = covariance[np.ix_(rows, rows)][np.tril_indices(rows.size)]
        words = {"places": self._at, "plain": self._plain.tolist(), "time": self._time}
        words |= {"rig": self._rig, "noise": self._noise.tolist(), "rows": rows.tolist()}
        attrs = {"settings": json.dumps(words), "model": self._identity}
        return write_sealed_array(np.concatenate([parts, block]), attrs, path, STATE)

    def _parts(self) -> list[FloatArray]:
        """Views of what samples and forecasts to come read, but for the covariance."""
        place, signature = self._at, self.signature
        filled, slots = place["filled"], len(self._plain)
        taps = 0 if self._follows is None else self._follows[0].taps.size
        longest = max(signature.state_delays, signature.input_delays, taps)
        record, tail = (max(filled - each, 0) for each in (self._record, slots + longest + 2))
        kept = [each[record if name == "u" else tail : filled] for name, each in self._kept.items()]
        pending = (place["taken"] - np.arange(filled - 1 - place["final"])) % slots
        used = [slot for slot in pending if not self._plain[slot]]
        of_slots = (self._gains, self._whitenings, self._deviations)
        gains = [each[slot] for slot in used for each in of_slots]
        return [*kept, *gains, self._history, self._free, self._innovation, self._squares]

    @cached_property
    def _identity(self) -> str:
        """Identity of the model."""
        found = hashlib.sha256(store.as_json(store.signature_json(self.signature)).encode())
        for each in (self._a, self._b, self._d, self._offset):
            found.update(np.ascontiguousarray(each).tobytes())
        return found.hexdigest()

    def _restore(self, kept: dict[str, Any], values: FloatArray) -> None:
        """Restore what :meth:`save` wrote."""
        self._at, self._time, self._plain[:] = kept["places"], kept["time"], kept["plain"]
        at = 0
        for part in self._parts():
            part[:] = values[at : at + part.size].reshape(part.shape)
            at += part.size
        rows = np.array(kept["rows"], dtype=int)
        block = np.zeros((rows.size, rows.size))
        block[np.tril_indices(rows.size)] = values[at:]
        self._filter.covariance[np.ix_(rows, rows)] = block + np.tril(block, -1).T


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
    kept = store.content(dataset, "settings")
    rig, noise = kept["rig"], zip(model.signature.states, kept["noise"], strict=False)
    like = xr.Dataset(
        {name: ((), 0.0, {"x_position": each}) for name, each in rig["positions"].items()},
        attrs=rig["run"],
    )
    live = model.live(like=like, noise={name: each for name, each in noise if each})
    if dataset.attrs["model"] != live._identity:
        raise RequestError(
            f"{path} is the state of another model. Load the model that was in service, or start "
            "anew with model.live()."
        )
    live._restore(kept, dataset["values"].values)
    return live


def held_samples(inside: BoolArray) -> npt.NDArray[np.intp]:
    """Leads that are all `inside` from the first on: how many of (steps, N), shape (N,)."""
    ended = np.concatenate([inside, np.zeros((1, inside.shape[1]), bool)])
    found: npt.NDArray[np.intp] = np.argmin(ended, axis=0)
    return found


def _quantile(level: float, spread: FloatArray, variance: FloatArray, drawn: bool) -> FloatArray:
    """Half-width of the band in standard deviations: Student's quantile.

    Part of the variance is the `spread` of few futures, where they were `drawn`, and the rest is
    known from free runs; the degrees of freedom are those of Satterthwaite (1946).
    """
    share = spread / np.maximum(variance, np.finfo(float).tiny)
    doubt = (1.0 - share) ** 2 / WINDOWS + (share**2 / PAIRS if drawn else 0.0)
    found: FloatArray = special.stdtrit(1.0 / np.maximum(doubt, 1e-6), 0.5 + 0.5 * level)
    return found


def _mean_predictor(
    members: Sequence[Dynamics], signature: Signature
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Mean of the members' one-step predictions: x' = offset + a x̂ + b û + d v.

    Physical units; blocks of a and b are oldest first.
    """
    count, s, z = len(signature.states), signature.state_delays, signature.input_delays
    offset = np.zeros(count)
    a = np.zeros((count, s + 1, count))
    b = np.zeros((count, z + 1, signature.input_scale.mean.size))
    d = np.zeros((count, signature.direct_scale.mean.size))
    for member in members:
        scale, (on_states, on_inputs) = member.state_scale, member.matrices
        split = (member.input_delays + 1) * b.shape[2]
        parts = (
            (a, on_states[:count], scale),
            (b, on_inputs[:count, :split], member.input_scale),
            (d[:, None], on_inputs[:count, split:], member.direct_scale),
        )
        offset += scale.mean
        for out, coefficients, own in parts:
            blocks = coefficients.reshape(count, -1, out.shape[2]) if out.shape[2] else out[:, :0]
            physical = blocks * scale.std[:, None, None] / own.std
            offset -= np.einsum("nlc,c->n", physical, own.mean)
            out[:, out.shape[1] - physical.shape[1] :] += physical[:, ::-1]
    number = len(members)
    flat = a.reshape(count, -1) / number, b.reshape(count, -1) / number
    return offset / number, *flat, d / number


def _rig(signature: Signature, like: xr.Dataset | None) -> dict[str, dict[str, float]]:
    """Attributes of a run that an alignment reads."""
    if like is None:
        return {"run": {}, "positions": {}}
    given: object = like
    if not isinstance(given, xr.Dataset):
        raise RequestError(
            f"like must be a Dataset, a run of the rig in service; received {type(given).__name__}."
        )
    positions = {
        name: float(like[name].attrs["x_position"])
        for name in signature.inputs
        if name in like and "x_position" in like[name].attrs
    }
    found = {key: float(like.attrs[key]) for key in RIG if key in like.attrs}
    return {"run": found, "positions": positions}


def _dataset(signature: Signature, rig: Mapping[str, Mapping[str, float]]) -> xr.Dataset:
    """Attributes of a rig as those of a run without samples."""
    run = xr.Dataset({each: ("time", np.zeros(0)) for each in signature.inputs}, attrs=rig["run"])
    for name, position in rig["positions"].items():
        run[name].attrs["x_position"] = position
    return run


def _places(
    signature: Signature,
    alignment: FittedAlignment | None,
    rig: Mapping[str, Mapping[str, float]],
) -> tuple[FloatArray, float]:
    """Positions of the inputs that are elevations, NaN where none is known, and the depth."""
    stated: dict[str, float | None] = {}
    depth = rig["run"].get("water_depth")
    if alignment is not None:
        stated |= zip(alignment.inputs, alignment.positions, strict=True)
        depth = alignment.water_depth if depth is None else depth
    stated |= rig["positions"]
    found = [None if depth is None else stated.get(name) for name in signature.inputs]
    places = np.array([math.nan if each is None else each for each in found])
    return places, math.nan if depth is None else depth


def _noise(signature: Signature, noise: Mapping[str, float] | None) -> FloatArray:
    out, names = np.zeros(len(signature.states)), signature.states
    units = [label.units for label in signature.state_labels]
    for name, value in ({} if noise is None else as_table(noise, "noise")).items():
        if name not in names:
            raise RequestError(
                f"noise names '{name}', which is not a state.{did_you_mean(name, names)} States: "
                f"{', '.join(names)}."
            )
        place = names.index(name)
        out[place] = positive(value, f"noise of {name}", units[place])
    return out


def _sample(name: str, value: object, names: Sequence[str]) -> FloatArray:
    """One sample in the order of the model, NaN for what is missing."""
    if value is None:
        return np.full(len(names), np.nan)
    if isinstance(value, Mapping):
        for key in value:
            if key not in names:
                raise RequestError(
                    f"{name} names '{key}', which the model does not know."
                    f"{did_you_mean(str(key), names)} It takes: {', '.join(names) or 'none'}."
                )
        value = [value.get(each, math.nan) for each in names]
    array = as_real(value, name)
    if array.shape != (len(names),):
        raise RequestError(
            f"{name} has shape {array.shape}; one number for each of {', '.join(names) or 'none'} "
            f"is needed: shape ({len(names)},)."
        )
    if np.any(np.isinf(array)):
        raise RequestError(f"{name} holds an infinite value. Give NaN for what was not measured.")
    return array.copy()
