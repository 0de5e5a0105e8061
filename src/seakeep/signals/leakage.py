"""Whether a test input repeats a training input, which makes the test meaningless."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy
from scipy import fft

from seakeep.arrays import ComplexArray, FloatArray, as_series, time_step
from seakeep.signals.waves import encounter_period, waves_part

REPEATED = 0.9
"""Modulus of the correlation from which a stretch of a test input repeats training."""
STRETCH = 30.0
"""Length of a stretch in zero-up-crossing periods; a shorter record is one stretch. They
overlap by half."""
REGULAR = 0.2
"""Envelopes that vary by less than this part of their mean are those of regular waves (a random
sea's vary by 0.52)."""


@dataclass(frozen=True)
class Leakage:
    """A stretch of test input that was in the training input.

    Parameters
    ----------
    share : float
        Fraction of the test record that repeats, 0 to 1; still water before and after the waves
        does not count.
    correlation : float
        Highest modulus of the correlation of the analytic signals.
    training : int
        Index of the training record.
    training_start, test_start : float
        Where the best matching stretch starts in each record, s from its first sample.
    phase : float
        Constant phase by which the repetition is turned, rad; zero is a plain repetition.
    """

    share: float
    correlation: float
    training: int
    training_start: float
    test_start: float
    phase: float


def find_leakage(
    training: Sequence[npt.ArrayLike],
    test: npt.ArrayLike,
    dt: float,
) -> Leakage | None:
    r"""Look for stretches of a test input that the training input holds, up to a constant phase.

    A sea of equally spaced components comes back after one over their spacing, turned by a
    constant phase; the record itself then correlates poorly, its analytic signal fully. Each
    stretch of the test record, without still water before and after the waves, is compared with all
    places in each training record by the modulus of the normalised correlation of the analytic
    signals.

    Parameters
    ----------
    training : sequence of array_like, each shape (time,)
        Training inputs, uniformly sampled, without gaps.
    test : array_like, shape (time,)
        Test input, the same step.
    dt : float
        Time step, s.

    Returns
    -------
    Leakage or None
        The best match and how much of the test record repeats; None if nothing does, or if the
        test input is a regular wave, which repeats by its nature.

    Raises
    ------
    RequestError
        If a number is out of range.
    DataError
        If a record has gaps.

    Notes
    -----
    Two independent seas whose spectrum is B wide exceed a modulus r over a stretch T by chance
    with probability about (1 − r²)^(BT − 1) at each lag: 1e-9 for 30 periods, a bandwidth of 0.4 of
    the mean frequency and r = 0.9.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> omega, phase = 2 * np.pi * (0.3 + 0.01 * np.arange(60)), rng.uniform(0, 6.28, 60)
    >>> t = np.arange(0, 180, 0.1)
    >>> sea = np.cos(np.outer(t, omega) + phase).sum(axis=1)  # comes back after 100 s
    >>> round(find_leakage([sea[:900]], sea[900:], 0.1).correlation, 2)
    1.0
    """
    step = time_step(dt)
    record = as_series(test, minimum=8)
    if np.ptp(record) == 0 or np.sum(np.diff(np.sign(record - record.mean())) > 0) < 2:
        return None
    part = waves_part(record, step)
    record = record[part]
    waves = _analytic(record)
    length = round(STRETCH * encounter_period(record, step) / step)
    length = min(max(length, 1), record.size)
    if _even(waves):
        return None
    best: Leakage | None = None
    repeated = np.zeros(record.size, dtype=bool)
    pool = [as_series(each, minimum=8) for each in training]
    ready = [(index, _analytic(each)) for index, each in enumerate(pool) if each.size >= length]
    starts = {*range(0, record.size - length + 1, max(length // 2, 1)), record.size - length}
    for start in sorted(starts):
        piece = waves[start : start + length]
        for index, reference in ready:
            match = _correlation(reference, piece)
            at = int(np.argmax(np.abs(match)))
            height = float(np.abs(match[at]))
            if height < REPEATED:
                continue
            repeated[start : start + length] = True
            if best is None or height > best.correlation:
                phase = float(np.angle(match[at]))
                begin = (part.start + start) * step
                best = Leakage(0.0, height, index, at * step, begin, phase)
    return best and replace(best, share=float(repeated.mean()))


def _analytic(series: FloatArray) -> ComplexArray:
    centred = series - series.mean()
    out: ComplexArray = scipy.signal.hilbert(centred, fft.next_fast_len(centred.size))
    return out[: centred.size]


def is_regular(series: npt.ArrayLike) -> bool:
    """Whether a record's envelope is as even as that of regular waves."""
    return _even(_analytic(as_series(series, minimum=8)))


def _even(waves: ComplexArray) -> bool:
    margin = waves.size // 20  # the envelope of a cut record is bent at its ends
    envelope = np.abs(waves[margin : waves.size - margin])
    return bool(envelope.std() < REGULAR * envelope.mean())


def _correlation(reference: ComplexArray, piece: ComplexArray) -> ComplexArray:
    """Normalised correlation of a piece with a reference at each place where it fits whole."""
    summed = np.conj(scipy.signal.correlate(reference, piece, mode="valid", method="fft"))
    power = np.cumsum(np.concatenate([[0.0], np.abs(reference) ** 2]))
    energy = power[piece.size :] - power[: -piece.size]
    norm = np.sqrt(np.maximum(energy * float(np.sum(np.abs(piece) ** 2)), 1e-300))
    return np.asarray(summed / norm)
