r"""Error measures of a forecast against a measurement (paper, section Performance metrics).

Arrays are ``(…, time, channel)``; leading axes (members, windows) are kept. SD is the measured
standard deviation over the window with ddof = 1, and k = 1.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple, TypeVar

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
    two are not judged, the third is (and found to be NaN).
    """

    p: FloatArray
    m: FloatArray
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
    spread = m.std(axis=-2, ddof=1)
    # A constant that is not a binary fraction has a spread of rounding, not of zero.
    slack = spread <= 1e-12 * np.abs(m).max(axis=-2)
    known = (("training_std", training_std, SLACK_PART), ("noise_std", noise_std, NOISE_FACTOR))
    for name, given, part in known:
        if given is not None:
            slack |= spread < part * as_real(given, name)
    return Pair(p, m, np.where(slack, np.nan, spread), ~slack)


Values = TypeVar("Values", bound=np.generic)


def _measure(
    of: Callable[[Pair], npt.NDArray[Values]],
) -> Callable[..., npt.NDArray[Values]]:
    """Make a measure of what :func:`paired` returns one of histories."""

    def measure(
        *,
        predicted: npt.ArrayLike,
        measured: npt.ArrayLike,
        training_std: npt.ArrayLike | None = None,
        noise_std: npt.ArrayLike | None = None,
    ) -> npt.NDArray[Values]:
        return of(paired(predicted, measured, training_std, noise_std))

    functools.update_wrapper(measure, of)
    del measure.__wrapped__  # type: ignore[attr-defined]
    return measure


@_measure
def is_slack(pair: Pair) -> BoolArray:
    """Say which channels are not judged, because the measurement barely moves or is noise.

    Parameters
    ----------
    predicted, measured, training_std, noise_std
        As for :func:`nrmse`.

    Returns
    -------
    ndarray of bool, shape (channel,), or Dataset
        True for a channel whose measured SD is below 1 % of its training SD, or below √2 times
        that of its noise, or zero.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.

    Examples
    --------
    >>> import numpy as np
    >>> measured = np.stack([np.sin(np.arange(9)), np.zeros(9)], axis=1)
    >>> is_slack(predicted=measured, measured=measured)
    array([False,  True])
    """
    return ~pair.judged


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


@_measure
def nrmse(pair: Pair) -> FloatArray:
    """Root mean square error of each channel, divided by its measured standard deviation.

    Parameters
    ----------
    predicted, measured : array_like, shape (…, time, channel), or Dataset
        Histories in the same units.
    training_std : array_like, shape (channel,), optional
        Standard deviations in training, by default the ones that a forecast carries; a channel
        whose measured SD is below 1 % of it (a slack line) is NaN.
    noise_std : array_like, shape (…, channel), optional
        Standard deviations of the noise, by default the ones that prepared runs carry
        (:func:`seakeep.signals.waves.noise_floor`); a channel more than half of whose measured
        variance is noise is NaN.

    Returns
    -------
    ndarray, shape (…, channel), or Dataset
        NRMSE (the summand of the paper's ANRMSE, k = 1, SD with ddof = 1 over the window). A
        forecast that diverged (NaN) gives NaN too.

    Raises
    ------
    RequestError
        If shapes or channels do not fit, or the window has fewer than two samples.
    DataError
        If the instants or units of two Datasets differ.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.linspace(0, 20, 400)
    >>> measured = np.stack([np.sin(t), np.cos(t)], axis=1)
    >>> nrmse(predicted=0.9 * measured, measured=measured).round(2)
    array([0.1, 0.1])
    """
    return root_mean_square(pair.p - pair.m) / pair.spread


@_measure
def anrmse(pair: Pair) -> FloatArray:
    """Average of :func:`nrmse` over the channels that can be judged (paper, equation ANRMSE).

    Parameters
    ----------
    predicted, measured, training_std, noise_std
        As for :func:`nrmse`.

    Returns
    -------
    float, or an array over the leading axes
        NaN if no channel can be judged, or the forecast diverged.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    return over_channels(root_mean_square(pair.p - pair.m) / pair.spread, pair.judged)


@_measure
def error_over_time(pair: Pair) -> FloatArray:
    """Error at each instant in measured SDs, averaged over the channels: ε(t) of the paper.

    Parameters
    ----------
    predicted, measured, training_std, noise_std
        As for :func:`nrmse`.

    Returns
    -------
    ndarray, shape (…, time), or DataArray

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    return over_channels(
        np.abs(pair.p - pair.m) / pair.spread[..., None, :], pair.judged[..., None, :]
    )


@_measure
def normalised_extremes_error(pair: Pair) -> FloatArray:
    """Mean absolute error of minimum and maximum of each channel, in measured SDs.

    Parameters
    ----------
    predicted, measured, training_std, noise_std
        As for :func:`nrmse`.

    Returns
    -------
    ndarray, shape (…, channel), or Dataset
        The summand of :func:`nammae`.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    return extremes_error(pair)


@_measure
def nammae(pair: Pair) -> FloatArray:
    """Normalised average minimum/maximum absolute error (paper, equation NAMMAE).

    Parameters
    ----------
    predicted, measured, training_std, noise_std
        As for :func:`nrmse`.

    Returns
    -------
    float, or an array over the leading axes
        Average of :func:`normalised_extremes_error` over the channels that can be judged.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    return over_channels(extremes_error(pair), pair.judged)


@_measure
def fit_percent(pair: Pair) -> FloatArray:
    r"""Fit of each channel as MATLAB's ``compare`` states it, percent.

    Parameters
    ----------
    predicted, measured, training_std, noise_std
        As for :func:`nrmse`.

    Returns
    -------
    ndarray, shape (…, channel), or Dataset
        :math:`100 (1 - \|y - \hat y\| / \|y - \bar y\|)`: 100 is perfect, 0 is no better than
        the mean, negative is worse.

    Raises
    ------
    RequestError, DataError
        As :func:`nrmse`.
    """
    norm = np.sqrt(np.sum((pair.p - pair.m) ** 2, axis=-2))
    return 100.0 * (1.0 - norm / (pair.spread * np.sqrt(pair.m.shape[-2] - 1)))


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
