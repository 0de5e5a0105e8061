r"""Carriers: short filters that read a wave at another place than its probe, and a slow position.

A wave of frequency ω is :math:`\cos(kx - \omega t)` at a place x. A carrier is a filter of some
samples about an instant whose output comes nearest, in mean square over a spectrum, to the
elevation at a distance and a lead from there: least squares over the products of such waves,
:math:`R h = r`. The spectrum is that of training, so that nothing is spent on waves that do not
occur; noise on the diagonal keeps the filter short and calm.
"""

from collections.abc import Sequence

import numpy as np
from scipy import linalg, signal

from seakeep.arrays import FloatArray, IntArray
from seakeep.waves import wavenumber

NOISE = 1e-2
"""Noise of the probes that carriers are designed for, per variance of the waves.

Between 1e-3 and 1e-2 forecasts on the virtual tank are alike; below, taps grow."""
FLOOR = 3e-3
"""Least power, per that of the peak, between 0.3 and 3 times the frequency of the encounters."""
EDGES = (0.2, 4.0)
"""Lowest and highest frequency of the design, per encounter frequency."""
LINES = 240
"""Frequencies of the design: their sum repeats after 60 encounter periods, which no carrier is."""
CUTOFF = 0.2
"""The slow position is the surge below this frequency, per encounter period.

Surge at wave frequency is part of the response that the model learns from the wave; following its
prediction too feeds its error back. Between 0.1 and 0.33 the skill on the virtual tank is flat."""
RIDGE = 1e-3
"""λ of the taps of the slow position, per sample, on the standardised surge."""
SETTLED = 5.0
"""Encounter periods at either end of a record in which its zero-phase filter has not settled."""


def mean_spectrum(
    records: Sequence[FloatArray], dt: float, period: float, highest: float = np.inf
) -> tuple[FloatArray, FloatArray]:
    """Frequencies and powers that carriers are designed for.

    Parameters
    ----------
    records : sequence of ndarray, each of shape (time, probe)
        Elevations of training.
    dt : float
        Time step, s.
    period : float
        Encounter period, s.
    highest : float, optional
        Highest frequency of free waves, Hz.

    Returns
    -------
    omega : ndarray, shape (LINES,)
        rad/s.
    power : ndarray, shape (LINES,)
        Mean over records and probes; they sum to one.
    """
    top = min(EDGES[1] / period, highest, 0.5 / dt)
    frequency = np.linspace(EDGES[0] / period, top, LINES)
    power = np.zeros(LINES)
    for record in records:
        length = min(len(record), round(16 * period / dt))
        known, density = signal.welch(record, 1.0 / dt, nperseg=length, axis=0)
        power += np.interp(frequency, known, density.mean(axis=1))
    waves = (frequency >= 0.3 / period) & (frequency <= 3.0 / period)
    power += FLOOR * power.max() * waves
    return 2 * np.pi * frequency, power / power.sum()


def carriers(
    omega: FloatArray,
    power: FloatArray,
    depth: float,
    dt: float,
    *,
    targets: FloatArray,
    probes: Sequence[float],
    back: int,
    ahead: int,
    leads: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Filters that read the elevation at other places.

    Parameters
    ----------
    omega, power : ndarray, shape (line,)
        From :func:`mean_spectrum`.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.
    dt : float
        Time step, s.
    targets : ndarray, shape (place,)
        Places that are read, m, positive downstream.
    probes : sequence of float
        Places of the probes, m.
    back, ahead : int
        Samples before and after an instant that its filter reads.
    leads : ndarray of int, shape (place,)
        Samples after the instant at which the elevation is wanted at each place.

    Returns
    -------
    taps : ndarray, shape (place, probe, back + ahead + 1)
        Weights of the samples, oldest first.
    errors : ndarray, shape (place,)
        Root mean square error in these waves, per their standard deviation.
    """
    k, lags = wavenumber(omega, depth), np.arange(-back, ahead + 1)
    amplitude = np.sqrt(power)

    def waves(place: FloatArray, instant: FloatArray) -> FloatArray:
        phase = np.outer(place, k) - np.outer(instant, omega)
        return np.concatenate([np.cos(phase) * amplitude, np.sin(phase) * amplitude], 1)

    read = waves(np.repeat(probes, lags.size), np.tile(lags * dt, len(probes)))
    wanted = waves(targets, leads.astype(float) * dt)
    products = read @ read.T
    products[np.diag_indices_from(products)] += NOISE
    crossed = wanted @ read.T
    taps = linalg.solve(products, crossed.T, assume_a="pos").T
    errors = np.sqrt(np.maximum(np.sum((wanted - taps @ read) ** 2, axis=1), 0.0))
    return taps.reshape(len(targets), len(probes), lags.size), errors


def slow_position(surge: FloatArray, period: float) -> FloatArray:
    """Surge below ``CUTOFF`` without delay; `period` in samples."""
    sections = signal.butter(4, 2 * CUTOFF / period, output="sos")
    padding = min(len(surge) - 1, round(SETTLED * period))
    return signal.sosfiltfilt(sections, surge, padlen=padding)


def position_taps(
    surges: Sequence[FloatArray], period: float, count: int, ahead: int
) -> FloatArray:
    """Weights of the last surges that come nearest to the slow position some samples later.

    They sum to one, so that a vessel at rest is where it is.

    Parameters
    ----------
    surges : sequence of ndarray, each of shape (time,)
        Surge of training, m.
    period : float
        Encounter period, samples.
    count : int
        Number of weights.
    ahead : int
        Samples after the newest surge at which the position is wanted.

    Returns
    -------
    ndarray, shape (count,)
        Newest first.
    """
    spread = np.concatenate(surges).std()
    gram, right, total = np.zeros((count, count)), np.zeros(count), 0
    for surge in surges:
        slow = slow_position(surge, period)
        edge = min(round(SETTLED * period), len(surge) // 8)
        windows = np.lib.stride_tricks.sliding_window_view(surge, count)[:, ::-1]
        first, last = max(edge, count - 1), len(surge) - max(edge, ahead)
        rows = windows[first - count + 1 : last - count + 1 - ahead]
        middle = surge.mean()
        apart, wanted = (rows - middle) / spread, (slow[first + ahead : last] - middle) / spread
        gram += apart.T @ apart
        right += apart.T @ wanted
        total += len(apart)
    gram[np.diag_indices_from(gram)] += RIDGE * total
    # Least squares under the condition that the weights sum to one.
    free, ones = linalg.solve(gram, np.stack([right, np.ones(count)], axis=1), assume_a="pos").T
    return free + ones * (1.0 - free.sum()) / ones.sum()
