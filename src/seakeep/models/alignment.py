"""Alignment of measured elevations to a moving vessel.

The elevation is carried by

    distance = surge + offset + (position of the probe in training − its position in the run) + the
    run's own ``attrs["probe_offset"]``,

positive downstream, so that one linear model holds wherever the vessel has drifted to. Records
are carried whole to a measured surge (:class:`FittedAlignment`), or step by step to where the
model itself says that the vessel is (:class:`Following`): there a bank of short filters reads each
elevation at places on a grid about the vessel (:mod:`seakeep.signals.propagation`), and the
vessel's place is a weighted sum of its last surges, measured ones in training and before a start,
predicted ones after it (:mod:`seakeep.core.recursion`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import compress
from typing import Literal, NamedTuple, Self

import numpy as np
import xarray as xr

from seakeep.arrays import (
    TINY,
    ComplexArray,
    Datasets,
    FloatArray,
    IntArray,
    check_choice,
    check_flag,
    names_of,
    number,
)
from seakeep.conventions import is_elevation
from seakeep.core.recursion import Place
from seakeep.errors import DataError, RequestError
from seakeep.models import labelled
from seakeep.models.labelled import ChannelLabel, Span
from seakeep.signals.propagation import (
    band_limit,
    carriers,
    carry_by_celerity,
    carry_by_dispersion,
    effective_celerity,
    mean_spectrum,
    position_taps,
)
from seakeep.signals.time_axis import stretches
from seakeep.waves import group_speed, wavenumber

Mode = Literal["effective", "dispersion"]
Surge = Literal["measured", "predicted", "none"]

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
MOST_PLACES = 4000
"""Of the grid: a vessel that moves over 25 lengths of the waves."""
BEYOND = 1.5
"""Part of the trained range of surge by which the grid goes beyond either end of it."""
REACH = 0.5
"""Error of a carrier, per SD of the waves, beyond which it reads nothing of use."""


@dataclass(frozen=True)
class ProbeAlignment:
    r"""How the wave input is aligned to the vessel.

    Parameters
    ----------
    mode : {"effective", "dispersion"}, optional
        One celerity for all waves, :math:`\eta(t) = \eta_{kn}(t - (x(t) - x_0)/c)` as in the
        paper, or linear dispersion, frequency by frequency, which does not hold at forward speed.
    surge : {"measured", "predicted", "none"}, optional
        Position that the elevation is carried to: the measured surge (an output read during the
        forecast, which is then conditional on it), the slow surge that the model itself predicts,
        step by step, which takes mode "dispersion", or none, the place at rest.
    celerity : float or "common", optional
        c of mode "effective", m/s. By default each run's own, ``attrs["celerity"]``, which
        ``prepare`` finds by correlation; a run without it is carried as "common" has it: with the
        mean celerity of the training runs, which are correlated up to their stops where they do
        not state it, between the two probes among the inputs that stand farthest apart.
    offset : float, optional
        Constant distance, m, by which the elevation is carried in all runs, positive downstream;
        the paper's :math:`-x_0` where surge does not count from the place at rest.
    surge_channel : str, optional
        Name of the surge channel, m, positive downstream.
    channels : sequence of str, optional
        Inputs that are elevations; by default those with an ``attrs["x_position"]``, else those
        whose name starts with "eta".
    optional : bool, optional
        Whether a model goes without the alignment where the training runs do not carry what it
        needs: water depth and elevations; and without the surge where that is no state, or no
        position of a probe is stated.

    Raises
    ------
    RequestError
        If a setting is out of range or does not go with the mode.
    """

    mode: Mode = "effective"
    surge: Surge = "measured"
    celerity: float | Literal["common"] | None = None
    offset: float = 0.0
    surge_channel: str = "surge"
    channels: tuple[str, ...] | None = None
    optional: bool = False

    @property
    def carries(self) -> bool:
        """Whether waves are carried at all where the probes of a run stand as in training."""
        return self.surge != "none" or self.offset != 0.0

    def __post_init__(self) -> None:
        check_flag("alignment: optional", self.optional)
        check_choice("alignment: mode", self.mode, ("effective", "dispersion"))
        check_choice("alignment: surge", self.surge, ("measured", "predicted", "none"))
        if self.surge == "predicted" and self.mode != "dispersion":
            raise RequestError(
                "alignment: surge = 'predicted' carries waves by their dispersion; received mode = "
                f"'{self.mode}'. Write mode = 'dispersion', or take surge = 'measured'."
            )
        number(self.offset, "alignment: offset", "a number (m, positive downstream)")
        if self.celerity is not None:
            if self.celerity != "common":
                meant = "a positive number, 'common' or None (m/s)"
                number(self.celerity, "alignment: celerity", meant, TINY)
            if self.mode != "effective":
                raise RequestError(
                    f"alignment: celerity = {self.celerity!r} belongs to mode = 'effective'; "
                    f"received mode = '{self.mode}'. Leave it out, or change the mode."
                )
        if self.channels is not None:
            example = f"channels = ['{self.channels}']"
            object.__setattr__(
                self, "channels", names_of(self.channels, "alignment: channels", example)
            )

    def fit(
        self,
        runs: Datasets,
        states: Sequence[str],
        inputs: Sequence[str],
        window: int | None,
    ) -> FittedAlignment | None:
        """Complete the settings from training runs that end where training ends.

        Parameters
        ----------
        runs : mapping of str to Dataset
            Training runs, cut at the end of their training windows.
        states, inputs : sequence of str
            Channels of the model.
        window : int or None
            Samples of the training windows; None for all of the runs.

        Returns
        -------
        FittedAlignment or None
            With celerity, depth, band and positions; None where an optional alignment cannot be
            made.

        Raises
        ------
        RequestError
            If the runs do not carry what the settings need.
        DataError
            If a record has gaps in the window, is constant, or the probes' records do not
            correlate.
        """
        first_name, first = next(iter(runs.items()))
        labelled.check_channels(first, inputs, first_name)
        if self.optional and self.missing(runs, states, inputs):
            still = replace(self, surge="none")  # for probes that stand elsewhere in other runs
            given = runs, states, inputs
            return None if still.missing(*given) else still.fit(*given, window)
        carried = _elevations(self, first, inputs)
        if self.surge == "predicted" and self.surge_channel not in states:
            raise RequestError(
                f"alignment: surge = 'predicted' needs '{self.surge_channel}' among the states; "
                f"received {', '.join(states)}. Add it, or choose surge = 'measured' or 'none'."
            )
        windows = labelled.last_samples(runs, window)
        depth, dt = _common_depth(runs), labelled.run_step(first, first_name)
        celerity = None if self.celerity == "common" else self.celerity
        limit = None
        elevations = [*compress(inputs, carried)]
        if self.mode == "dispersion":
            if depth is None:
                raise RequestError(
                    f"alignment: mode = 'dispersion' needs the water depth and {first_name} has no "
                    "attribute 'water_depth'. State water_depth (m, inf for deep water) in [rig], "
                    "or set run.attrs['water_depth']."
                )
            limits = [
                band_limit(labelled.sound_matrix(run, elevations, name), dt)
                for name, run in windows.items()
            ]
            limit = float(np.median(limits))
        elif celerity is None:
            celerity = _celerity(runs, elevations, depth)
        return FittedAlignment(
            settings=self,
            inputs=tuple(inputs),
            carried=carried,
            positions=tuple(labelled.position(first, channel) for channel in inputs),
            celerity=celerity,
            water_depth=depth,
            highest_frequency=limit,
        )

    def missing(self, runs: Datasets, states: Sequence[str], inputs: Sequence[str]) -> str:
        """What an optional alignment goes without, in words.

        Parameters
        ----------
        runs : mapping of str to Dataset
            Training runs.
        states, inputs : sequence of str
            Channels of the model.

        Returns
        -------
        str
            Empty where nothing is missing.
        """
        name, first = next(iter(runs.items()))
        if self.surge == "predicted" and self.surge_channel not in states:
            return f"'{self.surge_channel}' is not among the states"
        placed = self.channels or [
            each for each in inputs if labelled.position(first, each) is not None
        ]
        if not placed and self.surge != "none":
            return f"{name} states no position of a wave probe"
        if not placed and not any(is_elevation(each, rates=True) for each in inputs):
            return "no input is a wave elevation"
        if self.mode == "dispersion" and _common_depth(runs) is None:
            return "the runs state no water depth"
        return ""


class Rig(NamedTuple):
    """Distances by which inputs are carried, positions of their probes, and depth, m.

    A position that is not stated is None, a depth NaN.
    """

    offsets: tuple[float, ...]
    positions: tuple[float | None, ...]
    depth: float


@dataclass(frozen=True)
class FittedAlignment:
    """A fitted alignment.

    Parameters
    ----------
    settings : ProbeAlignment
        As it was asked for.
    inputs : tuple of str
        Channels of the model.
    carried : tuple of bool
        Which inputs are elevations.
    positions : tuple of float or None
        Position of each input's probe in training, m; None where the run did not state it.
    celerity : float or None
        The one given, or the mean of the training runs, m/s (mode "effective").
    water_depth : float or None
        m, of the training runs.
    highest_frequency : float or None
        Below which 99.9 % of the variance of the training input lies, Hz (mode "dispersion").
    """

    settings: ProbeAlignment
    inputs: tuple[str, ...]
    carried: tuple[bool, ...]
    positions: tuple[float | None, ...]
    celerity: float | None = None
    water_depth: float | None = None
    highest_frequency: float | None = None

    @property
    def placed(self) -> tuple[int, ...]:
        """Elevations at stated positions, by their places among the inputs."""
        carried = np.flatnonzero(self.carried).tolist()
        return tuple(column for column in carried if self.positions[column] is not None)

    def look_ahead(self, run: xr.Dataset) -> float:
        """Time that the slowest waves take over the constant distance they are carried upstream, s.

        A surge upstream reads nothing more: the record is continued by linear prediction there.
        """
        farthest = min(compress(self.rig(run).offsets, self.carried))
        return max(0.0, -farthest) / self._speed(run)

    def celerity_of(self, run: xr.Dataset) -> float | None:
        """Celerity at which a run is carried, m/s; None in mode "dispersion"."""
        if self.celerity is None or self.settings.celerity is not None:
            return self.celerity
        return float(run.attrs.get("celerity", self.celerity))

    def _speed(self, run: xr.Dataset) -> float:
        if (celerity := self.celerity_of(run)) is not None:
            return celerity
        assert self.highest_frequency is not None
        return float(group_speed(2 * np.pi * self.highest_frequency, self.rig(run).depth))

    def notes(self, run: xr.Dataset) -> dict[str, str | float]:
        """Mode, surge, celerity, the run's probe offset, with measured surge ``conditional_on``."""
        settings = self.settings
        out: dict[str, str | float] = {
            "alignment_mode": settings.mode,
            "alignment_surge": settings.surge,
        }
        if settings.surge == "measured":
            out["conditional_on"] = settings.surge_channel
        if settings.mode == "effective":
            out["alignment_celerity"] = self._speed(run)
        for key in ("probe_offset", "probe_offset_spread"):
            if key in run.attrs:
                out[key] = float(run.attrs[key])
        return out

    def describe(self) -> list[str]:
        """One line, and one more where the waves are read upstream."""
        settings = self.settings
        speed = "" if self.celerity is None else f", celerity {self.celerity:.4g} m/s"
        if speed and settings.celerity is None:
            speed += " in training, each run's own in forecasts"
        lines = [f"  alignment     mode {settings.mode}{speed}; surge {settings.surge}"]
        if not settings.carries:
            return ["  alignment     none, but by the offset of a run's probes where it has one"]
        if settings.offset < 0:
            lines.append(
                f"    offset {settings.offset:g} m carries the waves upstream: a forecast reads "
                "them before they reach the probe"
            )
        return lines

    def rig(self, run: xr.Dataset | None = None) -> Rig:
        """Offsets, positions and depth of a run; what it does not state is as in training."""
        attrs = {} if run is None else run.attrs
        stated = [None if run is None else labelled.position(run, each) for each in self.inputs]
        places = tuple(
            trained if here is None else here
            for here, trained in zip(stated, self.positions, strict=True)
        )
        depth = attrs.get("water_depth", self.water_depth)
        offset = self.settings.offset + float(attrs.get("probe_offset", 0.0))
        offsets = [
            offset if trained is None or here is None else offset + (trained - here)
            for here, trained in zip(places, self.positions, strict=True)
        ]
        return Rig(tuple(offsets), places, math.nan if depth is None else float(depth))

    def carry(self, run: xr.Dataset, spans: Sequence[Span]) -> FloatArray:
        """Inputs of a run, elevations carried to the vessel where spans read them.

        What surrounds a span without a gap counts, up to the look-ahead of the last instant.

        Returns
        -------
        ndarray, shape (time, Q)
            Elevations are NaN where no span reads them.
        """
        name, settings, rig = labelled.run_name(run, "the run"), self.settings, self.rig(run)
        dt = labelled.run_step(run, name)
        last = max(span.stop for span in spans) + math.ceil(self.look_ahead(run) / dt)
        values = labelled.channel_matrix(run, self.inputs, name)[:last]
        wanted = np.zeros(len(values), dtype=bool)
        for span in spans:
            wanted[span.first : span.stop] = True
        surge, reach = np.zeros(len(values)), (0.0, 0.0)
        if settings.surge != "none":  # read where it is allowed, and no further
            channel = [settings.surge_channel]
            surge = labelled.channel_matrix(run, channel, name)[:last, 0]
            labelled.check_units(run, settings.surge_channel, "m", name)
            for span in spans:
                known = surge[span.first : span.stop, None]
                labelled.check_finite(known, channel, run, name, span.first)
            reach = float(surge[wanted].min()), float(surge[wanted].max())
        out, elevations = values.copy(), np.flatnonzero(self.carried)
        out[:, elevations] = np.nan
        for begin, end in stretches(np.all(np.isfinite(values), axis=1)):
            read = begin + np.flatnonzero(wanted[begin:end])
            if not read.size:
                continue
            for column in elevations:
                series, offset = values[begin:end, column], rig.offsets[column]
                given = series, dt, (reach[0] + offset, reach[1] + offset)
                if settings.mode == "effective":
                    carrier = carry_by_celerity(*given, self._speed(run))
                else:
                    carrier = carry_by_dispersion(*given, rig.depth, self.highest_frequency)
                out[read, column] = carrier.at(surge[read] + offset, read - begin)[:, 0]
        return out


def _elevations(
    settings: ProbeAlignment, run: xr.Dataset, inputs: Sequence[str]
) -> tuple[bool, ...]:
    if settings.channels is not None:
        strangers = [channel for channel in settings.channels if channel not in inputs]
        if strangers:
            raise RequestError(
                f"alignment: channels names '{strangers[0]}', which is not among the inputs "
                f"({', '.join(inputs) or 'none'}). Name inputs of the model."
            )
        chosen = tuple(channel in settings.channels for channel in inputs)
    else:
        chosen = tuple(labelled.position(run, channel) is not None for channel in inputs)
        if not any(chosen):
            chosen = tuple(is_elevation(channel, rates=True) for channel in inputs)
    if not any(chosen):
        raise RequestError(
            f"alignment: none of the inputs ({', '.join(inputs) or 'none'}) is known as a wave "
            "elevation. Give the channels an attribute x_position ([rig.positions] of the "
            "campaign), or name them: alignment channels = ['…']."
        )
    return chosen


def _common_depth(runs: Datasets) -> float | None:
    """Water depth of the first run that states one, taken for all."""
    stated = [run.attrs["water_depth"] for run in runs.values() if "water_depth" in run.attrs]
    return float(stated[0]) if stated else None


def _celerity(runs: Datasets, elevations: Sequence[str], depth: float | None) -> float:
    """Celerity from the mean slowness over the runs."""
    slowness = []
    for name, run in runs.items():
        if "celerity" in run.attrs:
            slowness.append(1.0 / float(run.attrs["celerity"]))
            continue
        placed = {c: x for c in elevations if (x := labelled.position(run, c)) is not None}
        if len(set(placed.values())) < 2 or depth is None:
            raise RequestError(
                f"alignment: the celerity cannot be estimated from {name}: it takes the water "
                f"depth ({'missing' if depth is None else f'{depth:g} m'}) and two probes at "
                f"different positions among the inputs (positions stated: {len(placed)}). State "
                "celerity (m/s), or water_depth and positions in [rig]."
            )
        first, last = min(placed, key=placed.__getitem__), max(placed, key=placed.__getitem__)
        apart = placed[last] - placed[first]
        values = labelled.sound_matrix(run, [first, last], name)
        try:
            celerity = effective_celerity(
                values[:, 0], values[:, 1], labelled.run_step(run, name), apart, depth
            )
        except DataError as error:
            raise DataError(f"{name}, '{first}' and '{last}': {error}") from None
        slowness.append(celerity.lag / apart)
    return float(1.0 / np.mean(slowness))


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
        surge = alignment.settings.surge_channel
        tables = [labelled.sound_matrix(run, [*names, surge], n) for n, run in windows.items()]
        for name, run in windows.items():
            labelled.check_units(run, surge, "m", name)
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
        if places > MOST_PLACES:
            far = high - low
            raise DataError(
                f"{surge} moves over {far:.4g} m in training, {far / PER_WAVE / spacing:.0f} "
                f"wavelengths. Check that '{surge}' is in metres, or set alignment surge = 'none'."
            )
        return cls(
            alignment=alignment,
            column=list(states).index(surge),
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

    def gain(self, frequency: FloatArray) -> ComplexArray:
        """What carriers read at an instant of waves, over the wave then at the mean place.

        Parameters
        ----------
        frequency : ndarray, shape (frequency,)
            Hz.

        Returns
        -------
        ndarray of complex, shape (frequency, Q)
            1 of an input that is not carried.
        """
        rig, omega, place = self.alignment.rig(), 2 * np.pi * frequency[:, None, None], self.place
        at = np.array([each or 0.0 for each in rig.positions])
        out = np.ones((len(frequency), len(at)), dtype=complex)
        later = self.dt * np.arange(-self.back, self.ahead + 1)
        part, row = math.modf((place.centre - place.lowest) / place.spacing)
        for bank in self.banks(None):
            below, above = bank.taps[int(row) : int(row) + 2]
            apart = at[[*bank.columns]] - at[bank.column] - rig.offsets[bank.column] - place.centre
            waves = np.exp(1j * (omega * later - wavenumber(omega, rig.depth) * apart[:, None]))
            out[:, bank.column] = np.tensordot(waves, below + part * (above - below))
        return out

    @property
    def placed(self) -> tuple[int, ...]:
        """Elevations at stated positions, or the first, by their places among the inputs."""
        return self.alignment.placed or tuple(np.flatnonzero(self.alignment.carried).tolist()[:1])

    def _carriers(
        self, rig: Rig, columns: Sequence[int], targets: FloatArray, ahead: int, leads: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Filters of these probes; see :func:`seakeep.signals.propagation.carriers`."""
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
    def trained(self) -> slice:
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
        known = np.max([bank.errors[self.trained] for bank in banks], axis=0)
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
        taps, errors = following._carriers(
            rig, columns, targets, following.ahead, np.full(len(targets), following.lead)
        )
        if errors[following.trained].min() > REACH:
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
    rate = (after - before) / (2.0 * following.dt)
    return np.stack([now, rate], axis=1).reshape(-1, *taps.shape[1:])


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
