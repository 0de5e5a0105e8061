"""Waves that a model was trained in, and how the waves of a forecast compare with them.

Slow motions of which a training window holds too few cycles to estimate mean and spread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntFlag
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import xarray as xr
from scipy import fft, ndimage

from seakeep.arrays import TINY, BoolArray, Datasets, FloatArray, IntArray
from seakeep.conventions import is_elevation
from seakeep.core.spectra import split_bands
from seakeep.errors import warn
from seakeep.models import labelled
from seakeep.models.inputs import Signature
from seakeep.models.labelled import ChannelLabel
from seakeep.waves import GRAVITY

PER_OCTAVE = 6
"""Bands per octave: each is 12 % wide, as wide as the peak of a record of eight waves."""
TRAINED = 0.01
"""Part of the training energy from which a band, or a neighbour of it, counts as trained: the
leakage of a taper stays below it, and the tail of a sea above twice its peak frequency too."""
FAR = 3.0
"""SDs of a training run that the mean of an input may lie beyond those of the runs."""
STILL = 0.05
"""Part of the trained height up to which an input other than waves is still: its noise alone."""
CYCLES = 5.0
"""Periods from which on a spectrum shows which waves it holds."""


class Validity(IntFlag):
    """What lies outside the training; 0 where nothing does.

    Period, height and steepness are those of waves, mean is that of an input (or a value of its
    plan, beyond all of training), and surge that of the surge. In service consistency is that of
    errors of late, and lost says that waves a forecast reads were filled for long.
    """

    PERIOD = 1
    HEIGHT = 2
    STEEPNESS = 4
    SURGE = 8
    CONSISTENCY = 16
    LOST = 32
    MEAN = 64

    @property
    def words(self) -> str:
        """Names of the flags, or "inside"."""
        return (self.name or "INSIDE").lower().replace("|", ", ")


@dataclass(frozen=True, eq=False)
class Conditions:
    """Waves, means of inputs and mean surge against those of training.

    Parameters
    ----------
    trained : Coverage
        The training.
    peak : ndarray of int, shape (channel,)
        Band with the most energy.
    unseen : ndarray, shape (channel,)
        Part of the energy at periods that did not train.
    heights, steepnesses : ndarray, shape (channel,)
        As those of :class:`Coverage`.
    reasons : ndarray of bool, shape (4, channel)
        Whether period, height, steepness and mean lie outside.
    means : ndarray, shape (channel,)
        Mean of each input.
    surge : float or None
        Mean, m.
    reach : ndarray, shape (2,)
        Lowest and highest surge in training, m.
    labels : tuple of ChannelLabel
        Names and units of the channels.
    """

    trained: Coverage
    peak: IntArray
    unseen: FloatArray
    heights: FloatArray
    steepnesses: FloatArray
    reasons: BoolArray
    means: FloatArray
    surge: float | None
    reach: FloatArray
    labels: tuple[ChannelLabel, ...]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({'; '.join(self.sentences()) or self.validity.words})"

    @property
    def validity(self) -> Validity:
        """What lies outside the training."""
        drifts = self.surge is not None and not self.reach[0] <= self.surge <= self.reach[1]
        yes = np.append(self.reasons.any(axis=1), drifts)
        flags = [
            Validity.PERIOD,
            Validity.HEIGHT,
            Validity.STEEPNESS,
            Validity.MEAN,
            Validity.SURGE,
        ]
        return Validity(int(yes @ flags))

    @property
    def beyond(self) -> float:
        """Height over the trained one where it lies outside; the largest, 1 or more."""
        ratio = self.heights / np.maximum(self.trained.heights, TINY)
        return float(np.max(ratio, where=self.reasons[1], initial=1.0))

    def attrs(self) -> dict[str, Any]:
        """Attributes of a forecast: numbers of each input, and those trained."""
        out: dict[str, Any] = {
            "height": self.heights,
            "trained_height": self.trained.heights,
            "steepness": self.steepnesses,
            "trained_steepness": self.trained.steepnesses,
            "period": self.trained.periods[self.peak],
            "unseen_energy": self.unseen,
            "mean": self.means,
            "trained_low": self.trained.lows,
            "trained_high": self.trained.highs,
        }
        if self.surge is not None:
            out |= {"mean_surge": self.surge, "trained_surge": self.reach}
        return out

    def sentences(self) -> list[str]:
        """A sentence for each reason: periods, heights, steepnesses, means, mean surge."""
        texts: list[list[str]] = [[], [], [], []]
        for at, label in enumerate(self.labels):
            channel, unit = label.name, label.units
            if self.reasons[0, at]:
                peak, periods = self.peak[at], self.trained.periods
                trained = np.flatnonzero(self.trained.shares[at] >= TRAINED)
                low, high, where, word, nothing = trained[0], trained[-1], "outside", "to", ""
                if low < peak < high and not self.trained.known[at, peak]:
                    low, high = trained[trained < peak][-1], trained[trained > peak][0]
                    where, word, nothing = "between", "and", ", with none between"
                texts[0].append(
                    f"{channel}: the dominant period of {periods[peak]:.3g} s lies {where} "
                    f"the periods that trained the model ({periods[high]:.3g} {word} "
                    f"{periods[low]:.3g} s{nothing}); {100 * self.unseen[at]:.0f} % of the "
                    "energy is at periods it has not seen"
                )
            for group, what, values, most, of in (
                (1, "height", self.heights, self.trained.heights, f" {unit}" if unit else ""),
                (2, "steepness in deep water", self.steepnesses, self.trained.steepnesses, ""),
            ):
                if self.reasons[group, at]:
                    texts[group].append(
                        f"{channel}: a {what} of {values[at]:.3g}{of}, trained up to "
                        f"{most[at]:.3g}{of}"
                    )
            if self.reasons[3, at]:
                low, high = self.trained.lows[at], self.trained.highs[at]
                texts[3].append(
                    f"{channel}: a mean of {self.means[at]:.3g} {unit}, trained from {low:.3g} to "
                    f"{high:.3g} {unit} (mean and {FAR:g} SD)"
                )
        lines = ["; ".join(each) for each in texts if each]
        if Validity.SURGE in self.validity:
            assert self.surge is not None
            side = "downstream" if self.surge > self.reach[1] else "upstream"
            lines.append(
                f"a mean surge of {self.surge:.3g} m, {side} of the trained {self.reach[0]:.3g} to "
                f"{self.reach[1]:.3g} m"
            )
        return lines


@dataclass(frozen=True, eq=False)
class Coverage:
    """Energy of the training input in bands of frequency.

    Parameters
    ----------
    channels : tuple of str
        Inputs.
    first : int
        Number of the first band.
    shares : ndarray, shape (channel, band)
        Fraction of the energy in each band.
    heights, steepnesses : ndarray, shape (channel,)
        Largest ones of a window: four SDs, of regular waves 2√2, and that over the length in deep
        water of a wave of the mean period; the steepness of what is no elevation has no limit.
    lows, highs : ndarray, shape (channel,)
        Least and greatest mean of a run, less and plus ``FAR`` of its SDs.
    least, most : ndarray, shape (channel,)
        Extreme values, or `lows` and `highs` where these lie farther out.
    """

    channels: tuple[str, ...]
    first: int
    shares: FloatArray
    heights: FloatArray
    steepnesses: FloatArray
    lows: FloatArray
    highs: FloatArray
    least: FloatArray
    most: FloatArray

    @cached_property
    def edges(self) -> FloatArray:
        """Edges of the bands, Hz, shape (band + 1,)."""
        bands = self.first + np.arange(self.shares.shape[1] + 1)
        return 2.0 ** (bands / PER_OCTAVE)

    @cached_property
    def periods(self) -> FloatArray:
        """Middle of each band, s, shape (band,)."""
        return 1.0 / np.sqrt(self.edges[:-1] * self.edges[1:])

    @property
    def is_wave(self) -> BoolArray:
        """Inputs that are elevations, of which the steepness has a limit. Shape (channel,)."""
        return np.isfinite(self.steepnesses)

    @cached_property
    def known(self) -> BoolArray:
        """Bands that were trained, and those beside: a taper leaks there. Shape (channel, band)."""
        return ndimage.binary_dilation(self.shares >= TRAINED, [[True, True, True]])

    @classmethod
    def of(cls, channels: Sequence[str], series: Sequence[FloatArray], dt: float) -> Coverage:
        """Coverage of the windows of several runs, each (time, channel)."""
        longest = max(len(each) for each in series)
        first = int(np.floor(PER_OCTAVE * np.log2(1.0 / (longest * dt))))
        count = int(np.floor(PER_OCTAVE * np.log2(0.5 / dt))) + 1 - first
        energy = np.sum([band_energy(each, dt, first, count) for each in series], axis=0)
        heights, steepnesses = np.max([_heights(each, dt) for each in series], axis=0)
        steepnesses[[not is_elevation(each) for each in channels]] = np.inf  # see is_wave
        shares = energy / np.maximum(energy.sum(axis=1, keepdims=True), TINY)
        means = np.stack([each.mean(axis=0) for each in series])
        # A constant is itself but for its rounding.
        room = FAR * np.stack([each.std(axis=0) for each in series]) + 1e-9 * np.abs(means)
        lows, highs = (means - room).min(axis=0), (means + room).max(axis=0)
        every = np.concatenate([*series, lows[None], highs[None]])
        ends = every.min(axis=0), every.max(axis=0)
        return cls(tuple(channels), first, shares, heights, steepnesses, lows, highs, *ends)

    def quarter(self, dt: float) -> int:
        """Samples in a quarter of the period with most energy; of several inputs, the shortest."""
        return int(0.25 * self.periods[self.shares.argmax(axis=1).max(initial=0)] / dt)

    def is_trained(self, frequency: FloatArray) -> BoolArray:
        """Whether frequencies (Hz) lie in bands that were trained, or beside one.

        Returns
        -------
        ndarray of bool, shape (channel, frequency)
        """
        known = np.pad(self.known, ((0, 0), (1, 1)))  # nothing below and above the bands
        return known[:, np.searchsorted(self.edges, frequency, side="right")]

    def conditions(
        self,
        inputs: FloatArray,
        signature: Signature,
        surge: FloatArray | None = None,
        duration: float | None = None,
        waves: Sequence[int] | None = None,
    ) -> Conditions:
        """Compare inputs (time, channel) with those of training, over a `duration` in s.

        Of inputs that are not among `waves`, by their places, the mean alone is judged.

        The height of n irregular waves scatters by about 0.85/√n (one SD): two of that, and a
        tenth, are no reason, nor are periods of an input other than waves that is still beside the
        training, as a rudder amidships. Waves are judged from five periods on, means from two; none
        where a model departs from the means of each run.
        """
        dt = signature.dt
        energy = band_energy(inputs, dt, self.first, self.shares.shape[1])
        own = energy / np.maximum(energy.sum(axis=1, keepdims=True), TINY)
        lasts, peak = len(inputs) * dt if duration is None else duration, own.argmax(axis=1)
        repeats = lasts / self.periods[peak]
        means, (heights, steepnesses) = inputs.mean(axis=0), _heights(inputs, dt)
        margin = 1.1 + 1.7 / repeats**0.5
        unseen = np.where(self.known, 0.0, own).sum(axis=1)
        reasons = np.array(
            [
                (unseen > 0.5) & (self.is_wave | (heights > STILL * self.heights)),
                heights > margin * self.heights,
                steepnesses > margin * self.steepnesses,
                (means < self.lows) | (means > self.highs),
            ]
        )
        reasons[:3] &= self.known.any(axis=1) & own.any(axis=1) & (repeats > CYCLES)
        if waves is not None:
            reasons[:3] &= np.isin(np.arange(len(self.channels)), waves)
        if len(inputs) <= 8 * self.quarter(dt) or signature.input_map.reference:
            reasons[3] = False
        mean, reach, scale = None, np.array([-np.inf, np.inf]), signature.state_scale
        maps = signature.input_map
        is_place = "surge" in signature.states and (maps.follows or not maps.reference)
        if surge is not None and is_place and np.isfinite(surge).any():
            at, mean = signature.states.index("surge"), float(np.nanmean(surge))
            reach = scale.centre[at] + scale.reach[at] * np.array([-1.0, 1.0])
        labels = signature.input_labels
        return Conditions(
            self, peak, unseen, heights, steepnesses, reasons, means, mean, reach, labels
        )


def outside_training(
    model: Any, run: xr.Dataset, start: float, steps: int, surge: FloatArray | None = None
) -> list[str]:
    """Say in what a forecast lies outside the training: period, height, steepness, means.

    Parameters
    ----------
    model : Model
        A model that keeps its ``coverage``; of another one nothing is known.
    run : Dataset
        The run that is forecast.
    start : float
        Instant of the last measured state, s.
    steps : int
        Instants forecast.
    surge : ndarray, optional
        Surge that is forecast, m; by default the one that was measured.

    Returns
    -------
    list of str
        A sentence for each reason; of waves none where it is shorter than five periods.
    """
    coverage: Coverage | None = getattr(model, "coverage", None)
    if coverage is None or not coverage.channels:
        return []
    signature: Signature = model.signature
    name = labelled.run_name(run, "the run")
    time = run["time"].values.astype(float)
    at = labelled.nearest_sample(time, start, name)
    first = max(at - signature.input_delays, 0)
    values = labelled.channel_matrix(run, coverage.channels, name, slice(first, at + steps))
    if len(values) < 2 or not np.all(np.isfinite(values)):
        return []
    duration = steps * signature.dt
    if surge is None and "surge" in run:
        surge = run["surge"].values[(time > start) & (time <= start + duration + 1e-6)]
    return coverage.conditions(values, signature, surge, duration).sentences()


def band_energy(series: FloatArray, dt: float, first: int, count: int) -> FloatArray:
    """Energy of series (time, channel) in `count` bands from the number `first` on.

    Returns
    -------
    ndarray, shape (channel, band)
        Sums of a Hann-tapered periodogram; they add up to about the variance times the length.
    """
    taper, bands, begins, stop = _taper_and_bands(len(series), dt, first, count)
    tapered = np.ascontiguousarray(series.T)
    tapered = taper * (tapered - tapered.mean(axis=1, keepdims=True))
    power = np.abs(fft.rfft(tapered)) ** 2
    out = np.zeros((len(power), count))
    out[:, bands] = np.add.reduceat(power[:, :stop], begins, axis=1) / len(series)
    return out


@lru_cache(maxsize=8)
def _taper_and_bands(
    length: int, dt: float, first: int, count: int
) -> tuple[FloatArray, IntArray, IntArray, int]:
    """Hann taper, bands that hold frequencies, the first of each, and the one after the last."""
    frequency = fft.rfftfreq(length, dt)[1:]
    band = np.floor(PER_OCTAVE * np.log2(frequency)).astype(np.intp) - first
    inside = 1 + np.flatnonzero((band >= 0) & (band < count))
    bands, begins = np.unique(band[inside - 1], return_index=True)
    return np.hanning(length + 2)[1:-1], bands, inside[begins], int(inside[-1]) + 1


def _heights(inputs: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Heights of inputs (time, channel), and over the length of waves of their mean period.

    The fourth moment tells irregular waves, four SDs high, from regular ones of 2√2 SDs.
    """
    deviations = inputs - inputs.mean(axis=0)
    squares = deviations**2
    variance = np.maximum(squares.mean(axis=0), TINY)
    height = 4 * np.sqrt(np.mean(squares**2, axis=0) / (3 * variance))
    power = np.abs(fft.rfft(np.hanning(len(inputs))[:, None] * deviations, axis=0)) ** 2
    total = np.maximum(power.sum(axis=0), TINY)
    frequency = fft.rfftfreq(len(inputs), dt) @ power / total
    return height, 2 * np.pi / GRAVITY * height * frequency**2


FEWEST = 5
"""Slow periods below which the moments of a training window are those of single cycles (row 23 of
what the paper leaves open)."""
SPLIT = 3.0
"""Encounter periods that part slow motions from waves, as in the bands of a study."""
GOVERNS = 0.5
"""Part of a channel's variance from which its slow motion sets mean and standard deviation."""


@dataclass(frozen=True)
class SlowMotion:
    """Slow motion of a channel, and how much of it training holds.

    Parameters
    ----------
    channel : str
        The state.
    period : float
        Mean period between crossings of its mean, s; infinite where it crosses at most once.
    share : float
        Fraction of the channel's variance that is slow, 0 to 1.
    cycles : float
        Periods that the training windows hold in all.
    """

    channel: str
    period: float
    share: float
    cycles: float


def slow_motions(
    runs: Datasets, states: Sequence[str], trained: float, encounter_period: float
) -> list[SlowMotion]:
    """Find the states that a slow motion governs, and its period.

    Parameters
    ----------
    runs : mapping of str to Dataset
        Training data, all that there is up to where training ends: a slow period is seen better
        in it than in a short window.
    states : sequence of str
        Channels of the model.
    trained : float
        Length of the training windows, summed over the runs, s.
    encounter_period : float
        Mean encounter period, s; what is slower than three of them is slow.

    Returns
    -------
    list of SlowMotion
        States more than half of whose variance is slow, the one with the fewest cycles first.
        Runs with gaps in a state, and runs shorter than six encounter periods, are left
        out.
    """
    shortest = 2 * SPLIT * encounter_period
    out = []
    for state in states:
        crossings, seconds, slow, whole = 0, 0.0, 0.0, 0.0
        for name, run in runs.items():
            dt = labelled.run_step(run, name)
            values = labelled.channel_matrix(run, [state], name)
            if not np.all(np.isfinite(values)) or len(values) * dt < shortest:
                continue
            low = split_bands(values, dt, 1.0 / (SPLIT * encounter_period))[0][:, 0]
            low -= low.mean()
            crossings += int(np.count_nonzero(np.diff(np.sign(low))))
            seconds += len(values) * dt
            slow += float(np.sum(low**2))
            whole += float(np.sum((values - values.mean()) ** 2))
        if not whole > 0 or slow <= GOVERNS * whole:
            continue
        period = 2.0 * seconds / crossings if crossings > 1 else np.inf
        out.append(SlowMotion(state, float(period), slow / whole, trained / period))
    return sorted(out, key=lambda each: each.cycles)


def warn_of_slow_motions(
    runs: Datasets,
    states: Sequence[str],
    trained: float,
    encounter_period: float,
    what: str = "the training windows",
) -> None:
    """Warn where training holds fewer than five periods of a slow motion.

    Parameters
    ----------
    runs, states, trained, encounter_period
        As for :func:`slow_motions`.
    what : str, optional
        What the message calls the training windows.

    Warns
    -----
    SeakeepWarning
        One for all states.
    """
    few = [
        each
        for each in slow_motions(runs, states, trained, encounter_period)
        if each.cycles < FEWEST
    ]
    if not few:
        return
    worst = few[0]
    others = ", ".join(each.channel for each in few[1:])
    length = "longer than the record" if np.isinf(worst.period) else f"{worst.period:.3g} s"
    warn(
        f"{what}, {trained:.4g} s in all, hold {worst.cycles:.1f} periods of the slow motion of "
        f"{worst.channel} (period {length}, {100 * worst.share:.0f} % of its variance), fewer than "
        f"{FEWEST}{f'; the same holds for {others}' if others else ''}. Means and standard "
        "deviations are then those of single cycles. Lengthen the window, or train on more runs."
    )
