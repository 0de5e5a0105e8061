"""The recursion as an input map: waves where the vessel is, by its own surge.

For each elevation a bank of short filters reads the wave at places on a grid about the vessel
(:mod:`seakeep.signals.carriers`); the vessel's place is a weighted sum of its last surges, measured
ones in training and before a start, predicted ones after it (:mod:`seakeep.core.recursion`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import ClassVar, NamedTuple, Self

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.core.recursion import Place, read_table
from seakeep.errors import DataError, RequestError
from seakeep.models import labelled
from seakeep.models.checks import of_json
from seakeep.models.inputs import MAPS, FittedAlignment, Measured, depth_of
from seakeep.models.interface import Drive, Follows, Json, Regressors, Span, plain
from seakeep.models.labelled import ChannelLabel
from seakeep.models.observables import Observed
from seakeep.signals.carriers import carried, carriers, mean_spectrum, position_taps
from seakeep.sizes import MOST_CARRIED, check_size
from seakeep.waves import wavenumber

__all__ = ["SQUARED", "Bank", "Followed", "Following"]

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
    """Waves carried to where the vessel is, its slow surge squared, and observables of both.

    Parameters
    ----------
    alignment : FittedAlignment
        Elevations, positions, depth.
    inputs : tuple of ChannelLabel
        Inputs of the model.
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
    observed : Observed or None
        Observables: delayed ones are functions of the carried waves, others of the measured.
    """

    kind: ClassVar[str] = "following"
    reads_surge: ClassVar[bool] = False
    alignment: FittedAlignment
    inputs: tuple[ChannelLabel, ...]
    dt: float
    ahead: int
    lead: int
    back: int
    band: tuple[float, float]
    power: tuple[float, ...] = field(repr=False)
    place: Place
    observed: Observed | None = None

    @classmethod
    def fit(
        cls,
        alignment: FittedAlignment,
        runs: Mapping[str, xr.Dataset],
        window: int | None,
        look_ahead: int,
        observed: Observed | None,
    ) -> Self:
        """Fit taps of the position, grid and spectrum to training runs.

        Raises
        ------
        RequestError
            If a look-ahead below ``LEAD`` meets no probe up-wave of another.
        DataError
            If a run is shorter than eight encounter periods.
        """
        last = slice(None if window is None else -window, None)
        windows = {name: run.isel(time=last) for name, run in runs.items()}
        names = [each for each, yes in zip(alignment.inputs, alignment.carried, strict=True) if yes]
        first_name, first = next(iter(windows.items()))
        dt, period = labelled.run_step(first, first_name), labelled.mean_period(windows, names)
        least = math.ceil(LEAD * period)
        if look_ahead < least and len({alignment.positions[c] for c in alignment.placed}) < 2:
            raise RequestError(
                f"a look-ahead of {look_ahead} samples ({look_ahead / period:.2g} encounter "
                "periods) takes a probe up-wave: two elevations at stated positions ([rig."
                f"positions]). State them, or read {least} samples ahead or more: lead = "
                f"{round(0.75 * period)}."
            )
        records, surges = [], []
        for name, run in windows.items():
            time = np.asarray(run["time"].values, dtype=float)
            values = labelled.channel_matrix(run, [*names, alignment.settings.surge_channel], name)
            labelled.check_finite(values, [*names, alignment.settings.surge_channel], name, 0, time)
            records.append(values[:, :-1])
            surges.append(values[:, -1])
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
        peak = wavenumber(omega[[np.argmax(power)]], alignment.water_depth)[0]
        spacing = 2 * np.pi / float(peak) / PER_WAVE
        places = int(np.ceil((high - low + 2 * margin) / spacing)) + 2
        check_size("the surge spans so many waves that waves are read at", places, MOST_CARRIED,
                   "places", "Check the units of the surge (m).")  # fmt: skip
        return cls(
            alignment=alignment,
            inputs=labelled.channel_labels(first, alignment.inputs),
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
            observed=observed,
        )

    @property
    def follows(self) -> Follows:
        """Place of the vessel, and the state that it is a sum of."""
        settings = self.alignment.settings
        column = self.alignment.states.index(settings.surge_channel)
        return Follows(self.place, column, self.reach)

    @property
    def lead_samples(self) -> int:
        """Samples of input after an instant that its row reads."""
        return self.reads(Span(0, 0, 1)).stop - 1

    @cached_property
    def _around(self) -> tuple[int, int]:
        """Samples before and after an instant that its direct columns read."""
        direct = () if self.observed is None else [b for b in self.observed.bound if not b.delayed]
        return max([0, *(b.before for b in direct)]), max([0, *(b.ahead for b in direct)])

    def history(self, input_delays: int) -> int:
        """Samples of input before the start that a forecast with these delays reads."""
        return -self.reads(Span(-input_delays, 0, 1)).first

    def reads(self, span: Span) -> Span:
        """Samples that rows read; as many surges are read before as the place is a sum of."""
        before, after = self._around
        back = max(self.back, self.place.taps.size - 1)
        first = min(span.first - back, span.known - before)
        return Span(first, span.known, span.stop + max(self.ahead, after))

    def regressors(
        self, inputs: tuple[ChannelLabel, ...]
    ) -> tuple[tuple[ChannelLabel, ...], tuple[ChannelLabel, ...]]:
        """Labels of the carried waves with their observables, and of what has no delays."""
        delayed, direct = (
            (inputs, ()) if self.observed is None else self.observed.regressors(inputs)
        )
        return delayed, (*direct, SQUARED)

    @property
    def stretch(self) -> tuple[FloatArray, FloatArray]:
        """Factors of the standard deviations that columns are divided by."""
        delayed, direct = np.ones(len(self.inputs)), np.ones(0)
        if self.observed is not None:
            delayed, direct = self.observed.stretch
        return delayed, np.append(direct, 1.0)

    def wrap(self, drive: Drive, run: xr.Dataset | None, spans: Sequence[Span]) -> Followed:
        """Drive of a run, or of plain arrays that lie as in training."""
        assert isinstance(drive, Measured)
        return Followed(self, drive, self.banks(run))

    def banks(self, run: xr.Dataset | None) -> tuple[Bank, ...]:
        """Carriers of each elevation for the rig of a run; those of training without one.

        Raises
        ------
        RequestError
            If the probes of the run stand beyond the reach of the carriers.
        """
        rig = self._rig(run)
        found = _banks(self, rig)
        for bank in found:
            if bank.errors[self._known].min() > REACH:
                raise RequestError(
                    f"the probe of '{self.inputs[bank.column].name}' stands "
                    f"{rig.offsets[bank.column]:+.3g} m from where it stood in training, too far "
                    f"for carriers of {(self.back + self.ahead) * self.dt:.3g} s. Correct its "
                    "position, or fit with alignment surge = 'measured' or 'none'."
                )
        return found

    def foresight(self, run: xr.Dataset | None, count: int) -> tuple[FloatArray, tuple[int, ...]]:
        """Filters that predict placed elevations from all of them, in the rig of a run.

        Returns
        -------
        taps : ndarray, shape (count, probe, probe, back + 1)
            Of each of the next samples and of each probe; oldest sample first.
        placed : tuple of int
            Elevations at stated positions, by their places among the inputs.
        """
        rig = self._rig(run)
        placed = self.alignment.placed or tuple(np.flatnonzero(self.alignment.carried).tolist()[:1])
        at = [rig.positions[column] or 0.0 for column in placed]
        taps, _ = carriers(
            *self._waves,
            rig.depth,
            self.dt,
            targets=np.tile(at, count),
            probes=at,
            back=self.back,
            ahead=0,
            leads=np.repeat(np.arange(1, count + 1), len(at)),
        )
        return taps.reshape(count, len(at), *taps.shape[1:]), placed

    @property
    def _waves(self) -> tuple[FloatArray, FloatArray]:
        """Frequencies and powers that filters are designed for."""
        return np.linspace(*self.band, len(self.power)), np.array(self.power)

    def _rig(self, run: xr.Dataset | None) -> Rig:
        """Offsets, positions and depth of a run; those of training without one."""
        aligned, depth = self.alignment, self.alignment.water_depth
        offsets, here = np.full(len(self.inputs), aligned.settings.offset), aligned.positions
        if run is not None:
            offsets, here = aligned.offsets(run), aligned.positions_in(run)
            depth = depth_of(run, "the run", depth)
        assert depth is not None
        return Rig(tuple(offsets.tolist()), here, depth)

    @property
    def _trained(self) -> tuple[Bank, ...]:
        return _banks(self, self._rig(None))

    @property
    def _known(self) -> slice:
        """Places of the grid that training reached."""
        margin = BEYOND / (1 + 2 * BEYOND) * (self.place.count - 2)
        return slice(int(margin), self.place.count - int(margin))

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Places between which every carrier errs less than ``REACH``, m."""
        errors = np.max([bank.errors for bank in self._trained], axis=0)
        sound = self.place.grid[errors <= REACH]
        return (float(sound[0]), float(sound[-1])) if sound.size else (0.0, 0.0)

    def look_ahead(self, run: xr.Dataset | None, dt: float) -> float:
        """Seconds of input after an instant that its row reads."""
        return self.lead_samples * dt

    def notes(self, run: xr.Dataset) -> dict[str, str | float]:
        """What a forecast's attributes report of the alignment."""
        return self.alignment.notes(run)

    def describe(self, dt: float) -> list[str]:
        """Lines of a summary."""
        low, high = self.reach
        known = np.max([bank.errors[self._known] for bank in self._trained], axis=0)
        lines = [
            f"  alignment     mode {self.alignment.settings.mode}; surge predicted, in each step",
            f"    carriers    {self.back * dt:.3g} s back and {self.ahead * dt:.3g} s ahead of all "
            f"probes; they err {known.min():.2g} to {known.max():.2g} SD where training was",
            f"    reach       {low:.3g} to {high:.3g} m of slow surge, where they err less than "
            f"{REACH:g} SD",
        ]
        return lines + ([] if self.observed is None else self.observed.describe(dt))

    def to_json(self) -> Json:
        """All that was fitted."""
        place = {"taps": self.place.taps.tolist()} | {
            key: getattr(self.place, key) for key in ("lowest", "spacing", "count", "centre")
        }
        content = {
            "alignment": self.alignment.to_json(),
            "inputs": [
                {"name": each.name, "units": each.units, "long_name": each.long_name}
                for each in self.inputs
            ],
            "place": place,
            "observed": None if self.observed is None else self.observed.to_json(),
        }
        content |= {key: getattr(self, key) for key in _Kept.PLAIN}
        made: Json = plain(content)
        return made

    @classmethod
    def from_json(cls, content: Json) -> Self:
        """Rebuild from :meth:`to_json`."""
        kept = of_json(_Kept, content)
        place = kept.place
        taps = np.array(place.taps)
        made = Place(taps, place.lowest, place.spacing, place.count, place.centre)
        return cls(
            **{key: getattr(kept, key) for key in _Kept.PLAIN},
            alignment=kept.alignment,
            inputs=kept.inputs,
            place=made,
            observed=None if kept.observed is None else Observed.from_json(kept.observed),
        )


class Rig(NamedTuple):
    """Distances by which inputs are carried, positions of their probes, and depth, m."""

    offsets: tuple[float, ...]
    positions: tuple[float | None, ...]
    depth: float


@lru_cache(maxsize=16)
def _banks(made: Following, rig: Rig) -> tuple[Bank, ...]:
    """Carriers of each elevation in a rig; a model keeps those of some rigs."""
    out, aligned = [], made.alignment
    for column in np.flatnonzero(aligned.carried).tolist():
        own = rig.positions[column]
        columns = [column] if own is None else list(aligned.placed)
        places = [rig.positions[c] or 0.0 for c in columns]
        taps, errors = carriers(
            *made._waves,
            rig.depth,
            made.dt,
            targets=made.place.grid + rig.offsets[column] + (own or 0.0),
            probes=places,
            back=made.back,
            ahead=made.ahead,
            leads=np.full(made.place.count, made.lead),
        )
        out.append(Bank(column, tuple(columns), taps, errors))
    return tuple(out)


@dataclass(frozen=True)
class _KeptPlace:
    """What a file holds of a place."""

    taps: tuple[float, ...]
    lowest: float
    spacing: float
    count: int
    centre: float


@dataclass(frozen=True)
class _Kept:
    """What a file holds of the map."""

    PLAIN: ClassVar[tuple[str, ...]] = ("dt", "ahead", "lead", "back", "band", "power")
    alignment: FittedAlignment
    inputs: tuple[ChannelLabel, ...]
    dt: float
    ahead: int
    lead: int
    back: int
    band: tuple[float, float]
    power: tuple[float, ...]
    place: _KeptPlace
    observed: Json | None


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


@dataclass(frozen=True, eq=False)
class Followed:
    """Waves of a run about the vessel, and where it is by its measured surge."""

    made: Following
    measured: Measured
    banks: tuple[Bank, ...]

    def table(self, first: int, stop: int) -> FloatArray:
        """Delayed regressors of samples at all places, shape (time, place, n)."""
        made, low = self.made, self.measured.first
        values = self.measured.values[first - made.back - low : stop + made.ahead - low]
        count = made.place.count
        out = np.empty((stop - first, count, len(made.inputs)))
        out[:] = values[made.back : made.back + stop - first, None]
        for bank in self.banks:
            out[:, :, bank.column] = carried(bank.taps, values[:, bank.columns])
        if made.observed is None:
            return out
        return made.observed.with_delayed(out.reshape(-1, out.shape[2])).reshape(
            stop - first, count, -1
        )

    def direct(self, first: int, stop: int) -> FloatArray:
        """Columns without delays that no state drives, shape (time, m − 1)."""
        made, low = self.made, self.measured.first
        if made.observed is None:
            return np.empty((stop - first, 0))
        before, after = made._around
        begin = max(first - before, low)
        values = self.measured.values[begin - low : stop + after - low]
        return made.observed.direct(values)[first - begin : first - begin + stop - first]

    def rows(self, first: int, stop: int) -> Regressors:
        """Regressors by the measured surge; without one, of a vessel at rest in the mean place."""
        table, places = self.table(first, stop), self.places(first, stop)
        delayed = read_table(self.made.place, table, np.arange(stop - first), places)
        squared = self.made.place.squared(places)[:, None]
        return Regressors(delayed, np.concatenate([self.direct(first, stop), squared], axis=1))

    def places(self, first: int, stop: int) -> FloatArray:
        """Place of the vessel by its measured surge; at rest in the mean without one."""
        place, low = self.made.place, self.measured.first
        if self.measured.surge is None:
            return np.full(stop - first, place.centre)
        return place.of(self.measured.surge[first - low - place.taps.size + 1 : stop - low])


MAPS[Following.kind] = Following
