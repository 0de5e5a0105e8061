r"""Pairs of forecast and measurement, and the parts of error measures.

Arrays are ``(…, time, channel)``; leading axes (members, windows) are kept. SD is the measured
standard deviation over the window with ddof = 1, and k = 1.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from seakeep.arrays import BoolArray, FloatArray, as_real
from seakeep.errors import RequestError

SLACK_PART = 0.01
"""A channel whose measured SD is below this part of its training SD is not judged."""
NOISE_FACTOR = 2**0.5
"""Nor is one whose measured SD is below so many SDs of its noise: more than half of its variance
is noise there, which no model forecasts."""


class Pair(NamedTuple):
    """Two histories, the measured SD, and which channels are judged.

    The SD is NaN where a channel is slack or noise, and where the measurement has a gap; the first
    two are not judged, the third is (and found to be NaN). `least` is the SD below which a channel
    is not judged.
    """

    p: FloatArray
    m: FloatArray
    least: FloatArray
    spread: FloatArray
    judged: BoolArray


def paired(
    predicted: npt.ArrayLike,
    measured: npt.ArrayLike,
    training_std: npt.ArrayLike | None = None,
    noise_std: npt.ArrayLike | None = None,
) -> Pair:
    """Check two histories, and say which channels are judged."""
    p, m = as_real(predicted, "predicted"), as_real(measured, "measured")
    if m.ndim == 1 and p.ndim >= 1 and p.shape[-1:] == m.shape:
        p, m = p[..., None], m[:, None]
    if m.ndim < 2 or p.ndim < 2 or p.shape[-2:] != m.shape[-2:]:
        hint = (
            " One of them looks transposed."
            if p.ndim == m.ndim == 2 and p.shape == m.shape[::-1]
            else ""
        )
        raise RequestError(
            f"predicted has shape {p.shape} and measured {m.shape}; both must end in "
            f"(time, channel) of the same size.{hint}"
        )
    if m.shape[-2] < 2:
        raise RequestError(
            f"a window of {m.shape[-2]} sample(s) has no standard deviation; judge at least two."
        )
    least = np.zeros(m.shape[-1])
    known = (("training_std", training_std, SLACK_PART), ("noise_std", noise_std, NOISE_FACTOR))
    for name, given, part in known:
        if given is not None:
            least = np.fmax(least, part * as_real(given, name))
    return pair_of(p, m, least)


def pair_of(p: FloatArray, m: FloatArray, least: FloatArray) -> Pair:
    """A pair of histories (…, time, channel) that are known to fit."""
    spread = m.std(axis=-2, ddof=1)
    # A constant that is not a binary fraction has a spread of rounding, not of zero.
    slack = (spread <= 1e-12 * np.abs(m).max(axis=-2)) | (spread < least)
    return Pair(p, m, least, np.where(slack, np.nan, spread), ~slack)


def slack_share(load: FloatArray, noise_std: float) -> float:
    """Part of the samples at which a line is slack: its load is not above the SD of its noise.

    A sixth of the noise lies above it, and waves that just leave the line slack count as slack: the
    two about cancel, to 5 % of the samples in the virtual tank.

    Parameters
    ----------
    load : ndarray, shape (time,)
        Load of a line, which only pulls.
    noise_std : float
        Standard deviation of its noise, as :func:`seakeep.signals.waves.noise_floor` estimates it.

    Returns
    -------
    float
        From 0 to 1.
    """
    return float(np.mean(load <= noise_std))


def root_mean_square(error: FloatArray) -> FloatArray:
    """Root mean square over time."""
    return np.sqrt(np.mean(error**2, axis=-2))


def extremes_error(pair: Pair) -> FloatArray:
    """Mean absolute error of minimum and maximum over time, in measured SDs."""
    low = np.abs(pair.p.min(axis=-2) - pair.m.min(axis=-2))
    high = np.abs(pair.p.max(axis=-2) - pair.m.max(axis=-2))
    return 0.5 * (low + high) / pair.spread


def over_channels(values: FloatArray, judged: BoolArray) -> FloatArray:
    """Average over the judged channels; a diverged one, or one with a gap, is not left out."""
    judged = np.broadcast_to(judged, values.shape)
    count = judged.sum(axis=-1)
    total = np.where(judged, values, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
