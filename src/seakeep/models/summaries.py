"""Mean, standard deviation and quantiles of an ensemble, piece by piece in time."""

from __future__ import annotations

import errno
import math
import os
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import BinaryIO

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.errors import RequestError

__all__ = ["STATISTICS", "first_lost", "reduce_members", "stack_members", "summarize"]

FloatArray = npt.NDArray[np.float64]

STATISTICS = ("mean", "std", "lower", "upper")
HELD = 32 * 2**20
"""Bytes of member series that are held in memory; more is spilled to a temporary file."""
CHUNK = 8 * 2**20
"""Bytes of one piece in time of all members."""


def check_level(level: object) -> float:
    """Refuse a level that is not between 0 and 1."""
    if isinstance(level, bool) or not isinstance(level, int | float) or not 0 < level < 1:
        raise RequestError(
            f"level must lie between 0 and 1; received {level!r}. 0.95 is the 95 % band."
        )
    return float(level)


def statistics_of(values: FloatArray, level: float) -> FloatArray:
    """Statistics over the first axis.

    Parameters
    ----------
    values : ndarray, shape (member, …)
        Members.
    level : float
        Probability between the two quantiles.

    Returns
    -------
    ndarray, shape (4, …)
        Mean, standard deviation (ddof = 1; zero for one member) and the quantiles
        (1 ∓ `level`)/2, exact with linear interpolation between order statistics. NaN without
        members.
    """
    out = np.full((4, *values.shape[1:]), np.nan)
    if len(values):
        out[0] = values.mean(axis=0)
        out[1] = values.std(axis=0, ddof=1) if len(values) > 1 else 0.0
        out[2:] = np.quantile(values, [0.5 - level / 2, 0.5 + level / 2], axis=0)
    return out


def statistic_coordinate(level: float, calibrated: bool = False) -> xr.Variable:
    """Coordinate of the statistics, which says what the bounds of the band are."""
    bounds = f"the quantiles {0.5 - level / 2:g} and {0.5 + level / 2:g} of the members"
    bounds += ", moved outwards by the margin of a calibration" if calibrated else ""
    attrs = {
        "long_name": "statistic over the members",
        "comment": f"lower and upper are {bounds}; members that diverged are left out of all four",
    }
    return xr.Variable(("statistic",), list(STATISTICS), attrs)


def first_lost(values: FloatArray) -> npt.NDArray[np.int64]:
    """First instant at which a channel is NaN, or −1, of values (…, steps, N)."""
    if not np.isnan(values.sum()):
        return np.full(values.shape[:-2], -1)
    gone: npt.NDArray[np.bool_] = np.isnan(values.sum(axis=-1))
    first = np.argmax(gone, axis=-1)
    return np.where(np.take_along_axis(gone, first[..., None], axis=-1)[..., 0], first, -1)


def stack_members(
    series: Iterable[FloatArray], members: int, shape: tuple[int, int, int]
) -> FloatArray:
    """Members side by side, each put into its place as it comes.

    Parameters
    ----------
    series : iterable of ndarray, each of shape `shape`
        Members one after the other.
    members : int
        Their number.
    shape : tuple of int
        (window, steps, N).

    Returns
    -------
    ndarray, shape (window, member, steps, N)
        All of them.
    """
    out = np.empty((shape[0], members, *shape[1:]))
    for member, values in enumerate(series):
        out[:, member] = values
    return out


def reduce_members(
    series: Iterable[FloatArray],
    members: int,
    shape: tuple[int, int, int],
    level: float,
    threads: int = 1,
) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Reduce members to statistics without holding all of them.

    A member that is lost (NaN) anywhere in a window is left out of that window's statistics from
    its first instant on: what is left of it would weigh in one part of the band and not in the
    other.

    Parameters
    ----------
    series : iterable of ndarray, each of shape `shape`
        Members one after the other.
    members : int
        Their number.
    shape : tuple of int
        (window, steps, N).
    level : float
        Probability between the two quantiles.
    threads : int, optional
        Pieces reduced side by side once all members are there.

    Returns
    -------
    statistics : ndarray, shape (window, 4, steps, N)
        As :func:`statistics_of`.
    lost : ndarray of int, shape (member, window)
        First instant lost, or −1.
    """
    windows, steps, N = shape
    out = np.empty((windows, 4, steps, N))
    lost = np.full((members, windows), -1, dtype=np.int64)
    room = CHUNK // max(1, 8 * N * members * threads)
    length = max(1, min(math.ceil(steps / threads), room))
    pieces = math.ceil(steps / length)
    with _store((windows, pieces, members, length, N)) as store:
        for member, values in enumerate(series):
            lost[member] = first_lost(values)
            for window in range(windows):
                for piece in range(pieces):
                    part = values[window, piece * length : (piece + 1) * length]
                    store.put(window, piece, member, part)

        def reduce(window: int, piece: int) -> None:
            at = slice(piece * length, min((piece + 1) * length, steps))
            block = store.get(window, piece)[lost[:, window] < 0, : at.stop - at.start]
            out[window, :, at] = statistics_of(block, level)

        with ThreadPoolExecutor(threads) as pool:
            todo = [(w, p) for w in range(windows) for p in range(pieces)]
            for done in [pool.submit(reduce, *each) for each in todo]:
                done.result()
    return out, lost


class _Held:
    """Members in memory, of shape (window, piece, member, length, N)."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._values = np.empty(shape)

    def put(self, window: int, piece: int, member: int, part: FloatArray) -> None:
        """Keep a piece of a member, shape (time, N)."""
        self._values[window, piece, member, : len(part)] = part

    def get(self, window: int, piece: int) -> FloatArray:
        """A piece of all members, shape (member, length, N)."""
        found: FloatArray = self._values[window, piece]
        return found


class _Spilled:
    """The same in a file; read and written, not mapped, so that memory holds one piece alone."""

    def __init__(self, shape: tuple[int, ...], file: BinaryIO) -> None:
        self._shape, self._file = shape, file
        self._lock = threading.Lock()  # reading moves the place in the file
        self._size = 8 * math.prod(shape)
        with _spilling(self._size):
            self._reserve()

    def _reserve(self) -> None:
        """Take the room now where that can be done: a full disk is told before the work."""
        try:
            os.posix_fallocate(self._file.fileno(), 0, self._size)
        except (AttributeError, OSError) as error:
            if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
                raise
            self._file.truncate(self._size)

    def _seek(self, window: int, piece: int, member: int) -> None:
        place = np.ravel_multi_index((window, piece, member), self._shape[:3])
        self._file.seek(8 * int(place) * math.prod(self._shape[3:]))

    def put(self, window: int, piece: int, member: int, part: FloatArray) -> None:
        """Keep a piece of a member, shape (time, N)."""
        left = np.ascontiguousarray(part).data.cast("B")
        with _spilling(self._size):
            self._seek(window, piece, member)
            while left:
                left = left[self._file.write(left) :]

    def get(self, window: int, piece: int) -> FloatArray:
        """A piece of all members, shape (member, length, N)."""
        shape = self._shape[2:]
        with self._lock:
            self._seek(window, piece, 0)
            found = np.fromfile(self._file, dtype=np.float64, count=math.prod(shape))
        return found.reshape(shape)


@contextmanager
def _spilling(size: int) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RequestError(
            f"cannot keep {size / 2**20:.0f} MiB of members in the temporary folder "
            f"{tempfile.gettempdir()}: {error.strerror or error}. Free space there, name a folder "
            "on another disk in the environment variable TMPDIR, or ask for fewer steps, windows "
            "or members at a time."
        ) from error


@contextmanager
def _store(shape: tuple[int, ...]) -> Iterator[_Held | _Spilled]:
    if 8 * math.prod(shape) <= HELD:
        yield _Held(shape)
        return
    with tempfile.TemporaryFile(prefix="seakeep-", buffering=0) as file:
        yield _Spilled(shape, file)


def summarize(forecast: xr.Dataset, level: float = 0.95) -> xr.Dataset:
    """Mean, standard deviation and band of an ensemble forecast.

    Parameters
    ----------
    forecast : Dataset
        With the dimension ``member``, from ``forecast`` of an ensemble.
    level : float, optional
        Probability between ``lower`` and ``upper``.

    Returns
    -------
    Dataset
        The variables of `forecast` with ``statistic`` (mean, std, lower, upper) in the place of
        ``member``. Members that diverged are left out of all instants; ``attrs["members"]`` and
        ``attrs["diverged"]`` count them.

    Raises
    ------
    RequestError
        If there is no dimension ``member``, or `level` is not between 0 and 1.

    Examples
    --------
    >>> import xarray as xr
    >>> two = xr.Dataset({"heave": (("member", "time"), [[1.0, 2.0], [3.0, 4.0]])})
    >>> summarize(two).heave.sel(statistic="mean").values
    array([2., 3.])
    """
    level = check_level(level)
    if not isinstance(forecast, xr.Dataset) or "member" not in forecast.dims:
        received = (
            f"dimensions {', '.join(map(str, forecast.dims))}"
            if isinstance(forecast, xr.Dataset)
            else type(forecast).__name__
        )
        raise RequestError(
            f"summarize needs an ensemble forecast with the dimension 'member'; received "
            f"{received}. Pass what BayesianHankelDMDc(...).fit(...).forecast(...) returns."
        )
    channels = [
        name
        for name, variable in forecast.data_vars.items()
        if "member" in variable.dims and variable.dtype.kind == "f"
    ]
    lost = xr.zeros_like(forecast["member"], dtype=bool)
    for name in channels:
        others = [d for d in forecast[name].dims if d not in ("member", "window")]
        lost = lost | forecast[name].isnull().any(others)
    variables = {}
    for name in channels:
        values = forecast[name].transpose("member", ...)
        gone = lost.transpose("member", ...)
        variables[name] = _statistics_variable(values, gone, level)
    members, dropped = forecast.sizes["member"], int(lost.sum())
    coords: Mapping[str, object] = {
        str(name): coordinate
        for name, coordinate in forecast.coords.items()
        if "member" not in coordinate.dims
    }
    return xr.Dataset(
        variables,
        coords={**coords, "statistic": statistic_coordinate(level)},
        attrs={**forecast.attrs, "level": level, "members": members, "diverged": dropped},
    )


def _statistics_variable(values: xr.DataArray, lost: xr.DataArray, level: float) -> xr.Variable:
    dims = [str(dim) for dim in values.dims[1:]]
    if "window" not in lost.dims:
        result = statistics_of(values.values[~lost.values], level)
        return xr.Variable(("statistic", *dims), result, values.attrs)
    result = np.stack(
        [
            statistics_of(values.isel(window=w).values[~lost.isel(window=w).values], level)
            for w in range(values.sizes["window"])
        ]
    )
    rest = [dim for dim in dims if dim != "window"]
    return xr.Variable(("window", "statistic", *rest), result, values.attrs)
