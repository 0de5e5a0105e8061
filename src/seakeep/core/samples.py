"""Checks of the samples that the statistics take: finite, long enough, on a sound grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from seakeep.errors import DataError, RequestError

__all__ = ["as_bundle", "as_generator", "as_grid", "as_segments", "as_series", "whole_number"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]


def _finite(name: str, x: FloatArray, minimum: int, samples: int) -> FloatArray:
    if samples < minimum:
        raise DataError(
            f"{name} has {samples} sample(s); at least {minimum} are needed. Give a longer series."
        )
    bad = int(np.count_nonzero(~np.isfinite(x)))
    if bad:
        raise DataError(
            f"{name} holds {bad} value(s) that are NaN or infinite, of {x.size}. Fill the gaps of "
            "a measurement first; leave a diverged forecast out and count it."
        )
    return x


def as_series(name: str, values: npt.ArrayLike, minimum: int = 2) -> FloatArray:
    """Check a series.

    Parameters
    ----------
    name : str
        What the message calls it.
    values : array_like, shape (time,)
        Samples.
    minimum : int
        Fewest samples.

    Returns
    -------
    ndarray, shape (time,)

    Raises
    ------
    RequestError
        If it is not one-dimensional.
    DataError
        If it is too short, or a value is not finite.
    """
    x = np.asarray(values, dtype=float)
    if x.ndim != 1:
        raise RequestError(
            f"{name} has shape {x.shape}; one series of shape (time,) is needed. Select one "
            "channel and one run."
        )
    return _finite(name, x, minimum, x.size)


def as_bundle(name: str, values: npt.ArrayLike, minimum: int = 2) -> FloatArray:
    """Check one series, or several of equal length.

    Parameters
    ----------
    name : str
        What the message calls it.
    values : array_like, shape (time,) or (series, time)
        Samples; time runs along the last axis.
    minimum : int
        Fewest samples of each.

    Returns
    -------
    ndarray, shape (series, time)

    Raises
    ------
    RequestError
        If it has no axis or more than two, or holds no series.
    DataError
        If the series are too short, or a value is not finite.
    """
    x = np.asarray(values, dtype=float)
    if x.ndim not in (1, 2) or x.shape[0] == 0:
        raise RequestError(f"{name} has shape {x.shape}; (time,) or (series, time) is needed.")
    return _finite(name, np.atleast_2d(x), minimum, x.shape[-1])


def as_grid(values: npt.ArrayLike) -> FloatArray:
    """Check a grid of values at which a density is wanted.

    Parameters
    ----------
    values : array_like, shape (grid,)
        Values in the unit of the series.

    Returns
    -------
    ndarray, shape (grid,)

    Raises
    ------
    RequestError
        If it has fewer than two points, or does not increase.
    """
    grid = np.asarray(values, dtype=float)
    if grid.ndim != 1 or grid.size < 2:
        raise RequestError(f"the grid has shape {grid.shape}; at least two points are needed.")
    if not np.all(np.isfinite(grid)) or not np.all(np.diff(grid) > 0):
        raise RequestError("the grid must increase strictly and be finite; sort it, once each.")
    return grid


def as_segments(segments: Sequence[int] | None, samples: int) -> IntArray:
    """Check the lengths of the pieces of which a series was joined.

    Parameters
    ----------
    segments : sequence of int, or None
        Lengths in samples, in order; None for one piece.
    samples : int
        Length of the series.

    Returns
    -------
    ndarray of int, shape (segment,)

    Raises
    ------
    RequestError
        If they are not positive whole numbers that add up to the length.
    """
    if segments is None:
        return np.array([samples], dtype=np.intp)
    lengths = np.array([whole_number("a segment", item) for item in segments], dtype=np.intp)
    if int(lengths.sum()) != samples:
        raise RequestError(
            f"the segments add up to {int(lengths.sum())} samples and the series has {samples}. "
            "Give the length of each joined piece, in order."
        )
    return lengths


def whole_number(name: str, value: object, least: int = 1) -> int:
    """Check a whole number.

    Parameters
    ----------
    name : str
        What the message calls it.
    value : object
        What was received.
    least : int
        Smallest that is allowed.

    Returns
    -------
    int

    Raises
    ------
    RequestError
        If it is not a whole number, or too small.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise RequestError(f"{name} must be a whole number of at least {least}; received {value}.")
    return int(value)


def as_generator(rng: object) -> np.random.Generator:
    """Check a source of random numbers.

    Parameters
    ----------
    rng : object
        What was received.

    Returns
    -------
    numpy.random.Generator

    Raises
    ------
    RequestError
        If it is anything else, such as a seed.
    """
    if not isinstance(rng, np.random.Generator):
        raise RequestError(
            f"rng must be a numpy.random.Generator; received {type(rng).__name__}. Make one with "
            "numpy.random.default_rng(seed)."
        )
    return rng
