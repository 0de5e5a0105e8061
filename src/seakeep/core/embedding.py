r"""Delay embedding: training windows, extended snapshots and their matrices.

The extended vectors are :math:`\hat x_j = [x_j; x_{j-1}; …; x_{j-s}]` and
:math:`\hat u_j = [u_j; u_{j-1}; …; u_{j-z}]` (paper, equations of section HDMDc); the blocks are
lag-major, the newest first. Series are ``(time, channel)``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from seakeep.arrays import FloatArray, as_real
from seakeep.errors import RequestError

History = Literal["before", "inside"]


@dataclass(frozen=True)
class TrainingWindow:
    """Which samples of a run train a model.

    Parameters
    ----------
    first, last : int
        First and last sample of the window, both included.
    first_column : int
        Sample j of the first snapshot pair (j, j+1).
    """

    first: int
    last: int
    first_column: int

    @property
    def columns(self) -> int:
        """Number of snapshot pairs; zero or less where the run is too short."""
        return self.last - self.first_column

    @property
    def samples(self) -> slice:
        """The samples of the window, from which means and standard deviations are taken."""
        return slice(self.first, self.last + 1)


def training_window(
    last: int, window: int | None, state_delays: int, input_delays: int, history: History
) -> TrainingWindow:
    """Place the window of `window` samples that ends at sample `last`.

    Parameters
    ----------
    last : int
        Last sample of the window.
    window : int or None
        Number of snapshots m; None takes all samples up to `last`.
    state_delays, input_delays : int
        s and z.
    history : {"before", "inside"}
        Whether the delay history of the first snapshot lies before the window (or, where the
        run starts too late for that, as far into it as it must), or inside it.

    Returns
    -------
    TrainingWindow
        Its ``columns`` may be zero or negative: the caller knows the names for the message.

    """
    reach = max(state_delays, input_delays)
    first = 0 if window is None else last - window + 1
    earliest = first + reach if history == "inside" else reach
    return TrainingWindow(first, last, max(first, earliest))


def embed(series: FloatArray, delays: int, first: int, count: int) -> FloatArray:
    """Extended snapshots as columns.

    Parameters
    ----------
    series : ndarray, shape (time, channel)
        Series.
    delays : int
        Number of delayed copies, s or z.
    first, count : int
        Sample of the first column, and the number of columns.

    Returns
    -------
    ndarray, shape (channel * (delays + 1), count)
        Column i holds sample ``first + i`` and the `delays` samples before it, newest first.

    Raises
    ------
    RequestError
        If the series is not an array (time, channel) of real numbers, or a column lies outside it.

    Examples
    --------
    >>> import numpy as np
    >>> embed(np.arange(5.0)[:, None], delays=1, first=1, count=4)
    array([[1., 2., 3., 4.],
           [0., 1., 2., 3.]])
    """
    series = as_real(series, "the series")
    if series.ndim != 2 or not 0 <= first - delays <= first <= first + count <= series.shape[0]:
        raise RequestError(
            f"columns {first} to {first + count - 1} with {delays} delays do not lie in a series "
            f"of shape {series.shape}; (time, channel) with all of these samples is needed."
        )
    newest_first = np.ascontiguousarray(series[first - delays : first + count][::-1])
    columns = sliding_window_view(newest_first, delays + 1, axis=0)[::-1]
    return columns.transpose(0, 2, 1).reshape(count, -1).T


def block_means(series: FloatArray, blocks: Sequence[tuple[int, int]]) -> FloatArray:
    """Means of a series over blocks of lags.

    Parameters
    ----------
    series : ndarray, shape (time, channel)
        Samples; missing ones count as zero.
    blocks : sequence of (int, int)
        Of each block the lag before its first, and its last.

    Returns
    -------
    ndarray, shape (time, channels of each block)
        Zero where a block begins before the series.
    """
    total = np.cumsum(np.nan_to_num(series), axis=0)
    total = np.concatenate([np.zeros((1, series.shape[1])), total])
    out = np.zeros((len(series), len(blocks), series.shape[1]))
    for number, (before, last) in enumerate(blocks):
        sums = total[last - before : len(series) - before] - total[: max(len(series) - last, 0)]
        out[last:, number] = sums / (last - before)
    return out.reshape(len(series), -1)


def spread_means(
    coefficients: FloatArray, states: int, delays: int, blocks: Sequence[tuple[int, int]]
) -> FloatArray:
    """Coefficients of delayed states instead of :func:`block_means`, on the last axis.

    Parameters
    ----------
    coefficients : ndarray, shape (…, N(s+1) + others + N · blocks)
        Of the states, of other regressors, and of the means.
    states, delays : int
        N and s, where the first block begins after.
    blocks : sequence of (int, int)
        The blocks, side by side.

    Returns
    -------
    ndarray, shape (…, N(last + 1) + others)
        Each mean is a sum of delayed states of equal weights.
    """
    size, end = states * (delays + 1), coefficients.shape[-1] - states * len(blocks)
    parts = [coefficients[..., :size]]
    for number, (before, last) in enumerate(blocks):
        own = coefficients[..., end + number * states : end + (number + 1) * states]
        parts.append(np.tile(own / (last - before), last - before))
    return np.concatenate([*parts, coefficients[..., size:end]], axis=-1)
