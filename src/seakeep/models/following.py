"""The recursion: waves where the vessel is, by its own surge.

For each elevation a bank of short filters reads the wave at places on a grid about the vessel
(:mod:`seakeep.signals.carriers`); the vessel's place is a weighted sum of its last surges, measured
ones in training and before a start, predicted ones after it (:mod:`seakeep.core.recursion`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import compress
from typing import Self

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, FloatArray, IntArray
from seakeep.core.recursion import Place
from seakeep.errors import DataError, RequestError
from seakeep.models import labelled
from seakeep.models.alignment import FittedAlignment, Rig
from seakeep.models.labelled import ChannelLabel
from seakeep.signals.carriers import carriers, mean_spectrum, position_taps
from seakeep.waves import wavenumber

SQUARED = ChannelLabel("slow_surge_squared", "m^2", "slow surge about its mean, squared")
BACK = 3.0
"""Encounter periods before an instant from which carriers read the probes.

Half a period is enough for a vessel that drifts down-wave of its probe; up-wave of it the other
probes tell, which saw the wave before (ANRMSE on the virtual tank .115 → .110)."""
LEAD = 0.56
"""Encounter periods by which carried waves lead at least; where probes are read no further, those
up-wave say what is there."""
PER_WAVE = 40
"""Places of the grid per length of the peak's wave: four times as far apart cost 0.015 SD."""
BEYOND = 1.5
"""Part of the trained range of surge by which the grid goes beyond either end of it."""
REACH = 0.5
"""Error of a carrier, per SD of the waves, beyond which it reads nothing of use."""


@dataclass(frozen=True, eq=False)
class Following:
    """Waves carried to where the vessel is, by what the model itself predicts.

    Parameters
    ----------
    alignment : FittedAlignment
        Elevations, positions, depth.
    column : int
        Place of the surge among the states.
    dt : float
        Time step, s.
    ahead : int
        Samples after an instant up to which its row reads the probes.
    lead : int
        Samples after an instant at which the carried wave is wanted.
    back : int
        Samples before an instant from which its row reads the probes.
    band : tuple of float
        Lowest and highest frequency of the spectrum, rad/s.
    power : tuple of float
        Spectrum of the waves of training; the powers sum to one.
    place : Place
        Weights of the surge, and the grid.
    """

    alignment: FittedAlignment
    column: int
    dt: float
    ahead: int
    lead: int
    back: int
    band: tuple[float, float]
    power: tuple[float, ...] = field(repr=False)
    place: Place

    @classmethod
    def fit(
        cls,
        alignment: FittedAlignment,
        runs: Datasets,
        states: Sequence[str],
        window: int | None,
        look_ahead: int,
    ) -> Self:
        """Fit taps of the position, grid and spectrum to training runs.

        Raises
        ------
        RequestError
            If a look-ahead below ``LEAD`` meets no probe up-wave of another.
        DataError
            If a run is shorter than eight encounter periods.
        """
        windows = labelled.last_samples(runs, window)
        names = [*compress(alignment.inputs, alignment.carried)]
        dt, period = labelled.common_step(windows), labelled.mean_period(windows, names)
        least = math.ceil(LEAD * period)
        if look_ahead < least and len({alignment.positions[c] for c in alignment.placed}) < 2:
            raise RequestError(
                f"a look-ahead of {look_ahead} samples ({look_ahead / period:.2g} encounter "
                "periods) takes a probe up-wave: two elevations at stated positions ([rig."
                f"positions]). State them, or read {least} samples ahead or more: lead = "
                f"{round(0.75 * period)}."
            )
        channels = [*names, alignment.settings.surge_channel]
        tables = [labelled.sound_matrix(run, channels, name) for name, run in windows.items()]
        records, surges = [each[:, :-1] for each in tables], [each[:, -1] for each in tables]
        highest = alignment.highest_frequency
        omega, power = mean_spectrum(
            records, dt, period * dt, np.inf if highest is None else highest
        )
        count = max(round(period), 2)
        if short := [n for n, each in zip(windows, surges, strict=True) if len(each) < 8 * count]:
            raise DataError(
                f"{short[0]} is too short to follow its surge: eight encounter periods ("
                f"{8 * count} samples) are needed. Give a longer run, or set alignment surge = "
                "'none'."
            )
        every = np.concatenate(surges)
        low, high = float(every.min()), float(every.max())
        margin = BEYOND * (high - low)
        assert alignment.water_depth is not None
        peak = float(wavenumber(omega[np.argmax(power)], alignment.water_depth))
        spacing = 2 * np.pi / peak / PER_WAVE
        places = int(np.ceil((high - low + 2 * margin) / spacing)) + 2
        return cls(
            alignment=alignment,
            column=list(states).index(alignment.settings.surge_channel),
            dt=dt,
            ahead=look_ahead,
            lead=max(look_ahead, least),
            back=round(BACK * period),
            band=(float(omega[0]), float(omega[-1])),
            power=tuple(power.tolist()),
            place=Place(
                position_taps(surges, period, count, max(look_ahead, least)),
                low - margin,
                spacing,
                places,
                float(every.mean()),
            ),
        )

    def banks(self, run: xr.Dataset | None) -> tuple[Bank, ...]:
        """Carriers of each elevation for the rig of a run; those of training without one.

        Raises
        ------
        RequestError
            If the probes of the run stand beyond the reach of the carriers.
        """
        return _banks(self, self.alignment.rig(run))

    def foresight(self, run: xr.Dataset | None, count: int) -> FloatArray:
        """Filters that predict :attr:`placed` elevations from themselves and those up-wave.

        Returns
        -------
        ndarray, shape (count, probe, probe, back + 1)
            Of each of the next samples and of each probe, in the rig of a run; oldest sample first.
        """
        rig, placed = self.alignment.rig(run), self.placed
        at = [rig.positions[column] or 0.0 for column in placed]
        taps = np.zeros((count, len(at), len(at), self.back + 1))
        for probe, place in enumerate(at):
            # What a probe down-wave adds makes filters that grow once they read what they filled.
            read = [k for k, each in enumerate(at) if each <= place]
            columns, leads = [placed[k] for k in read], np.arange(1, count + 1)
            own, _ = self._carriers(rig, columns, np.full(count, place), 0, leads)
            taps[:, probe, read] = own
        return taps

    def lines(self, run: xr.Dataset | None, places: tuple[float, ...]) -> FloatArray:
        """Filters that read the wave at places in the rig of a run, an instant after their row.

        Parameters
        ----------
        run : Dataset or None
            The run; the rig of training without one.
        places : tuple of float
            Places, m, positive downstream of the last probe.

        Returns
        -------
        ndarray, shape (2 places, probe, back + ahead + 1)
            Elevation and rate at each place, read from the :attr:`placed` probes; oldest sample
            first.
        """
        return _lines(self, self.alignment.rig(run), places)

    @property
    def placed(self) -> tuple[int, ...]:
        """Elevations at stated positions, or the first, by their places among the inputs."""
        return self.alignment.placed or tuple(np.flatnonzero(self.alignment.carried).tolist()[:1])

    def _carriers(
        self, rig: Rig, columns: Sequence[int], targets: FloatArray, ahead: int, leads: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Filters of these probes; see :func:`seakeep.signals.carriers.carriers`."""
        return carriers(
            np.linspace(*self.band, len(self.power)),
            np.array(self.power),
            rig.depth,
            self.dt,
            targets=targets,
            probes=[rig.positions[column] or 0.0 for column in columns],
            back=self.back,
            ahead=ahead,
            leads=leads,
        )

    @property
    def _known(self) -> slice:
        """Places of the grid that training reached."""
        margin = BEYOND / (1 + 2 * BEYOND) * (self.place.count - 2)
        return slice(int(margin), self.place.count - int(margin))

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Places between which every carrier errs less than ``REACH`` in the rig of training, m."""
        sound = self.place.grid[np.max([bank.errors for bank in self.banks(None)], axis=0) <= REACH]
        return (float(sound[0]), float(sound[-1])) if sound.size else (0.0, 0.0)

    def describe(self) -> list[str]:
        """Lines of a summary."""
        (low, high), banks = self.reach, self.banks(None)
        known = np.max([bank.errors[self._known] for bank in banks], axis=0)
        return [
            f"  alignment     mode {self.alignment.settings.mode}; surge predicted, in each step",
            f"    carriers    {self.back * self.dt:.3g} s back and {self.ahead * self.dt:.3g} s "
            f"ahead of all probes; they err {known.min():.2g} to {known.max():.2g} SD where "
            "training was",
            f"    reach       {low:.3g} to {high:.3g} m of slow surge, where they err less than "
            f"{REACH:g} SD",
        ]


@lru_cache(maxsize=16)
def _banks(following: Following, rig: Rig) -> tuple[Bank, ...]:
    """Carriers of each elevation in a rig; a model keeps those of some rigs."""
    out, aligned = [], following.alignment
    for column in np.flatnonzero(aligned.carried).tolist():
        own = rig.positions[column]
        columns = [column] if own is None else list(aligned.placed)
        targets = following.place.grid + rig.offsets[column] + (own or 0.0)
        leads = np.full(len(targets), following.lead)
        taps, errors = following._carriers(rig, columns, targets, following.ahead, leads)
        if errors[following._known].min() > REACH:
            raise RequestError(
                f"the probe of '{aligned.inputs[column]}' stands {rig.offsets[column]:+.3g} m from "
                "where it stood in training, too far for carriers of "
                f"{(following.back + following.ahead) * following.dt:.3g} s. Correct its "
                "position, or fit with alignment surge = 'measured' or 'none'."
            )
        out.append(Bank(column, tuple(columns), taps, errors))
    return tuple(out)


@lru_cache(maxsize=16)
def _lines(following: Following, rig: Rig, places: tuple[float, ...]) -> FloatArray:
    """Filters of :meth:`Following.lines`."""
    placed, leads = following.placed, np.tile([0, 1, 2], len(places))
    last = max(placed, key=lambda column: rig.positions[column] or 0.0)
    targets = np.repeat(places, 3) + rig.offsets[last] + (rig.positions[last] or 0.0)
    taps, _ = following._carriers(rig, placed, targets, following.ahead, leads)
    before, now, after = taps.reshape(len(places), 3, *taps.shape[1:]).swapaxes(0, 1)
    filters = np.stack([now, (after - before) / (2.0 * following.dt)], axis=1)
    return filters.reshape(-1, *taps.shape[1:])


@dataclass(frozen=True, eq=False)
class Bank:
    """Carriers of one elevation.

    Parameters
    ----------
    column : int
        Place of the elevation among the inputs.
    columns : tuple of int
        Probes that it is read from.
    taps : ndarray, shape (place, probe, back + ahead + 1)
        Weights, oldest sample first.
    errors : ndarray, shape (place,)
        RMS error by design, per SD of the waves.
    """

    column: int
    columns: tuple[int, ...]
    taps: FloatArray
    errors: FloatArray
