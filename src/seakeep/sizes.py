"""Sizes, judged before the work: what a request would take, and the most that is allowed.

Bounds are of requests that no measurement needs, not of machines: the same file is refused
everywhere.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from seakeep.errors import DataError, RequestError, warn

if TYPE_CHECKING:
    import h5py

__all__ = ["check_declared", "check_numbers", "check_size", "most_bytes", "too_large"]

MOST_NUMBERS = 250_000_000
"""Numbers that a run, or the redrawn series of a bootstrap, hold at once: 1907 MiB."""
LONG_NUMBERS = 50_000_000
"""Numbers of a run that take some minutes to prepare."""
LONG_MATRIX = 3000**2
"""Numbers of a model's matrix whose eigenvalues take a minute."""
LEAST_PERIODS, MOST_PERIODS = 1e-6, 1e6
"""Encounter periods of a free run, and seconds of one: beyond them numbers of samples overflow."""
MOST_CHANNELS = 1000
"""Channels of a campaign: each is checked, drawn and written, some hundredths of a second long."""
MOST_MEMBERS, LONG_MEMBERS = 1_000_000, 100_000
"""Members of an ensemble: their list of draws alone fills the memory, or a fit takes an hour."""
MOST_CELLS, LONG_CELLS = 100_000_000, 1_000_000
"""Forecasts of a study, each of some milliseconds: a week of work, or hours."""
MOST_SERIES = 100_000
"""Redrawn series of a study: 400 MB of densities."""
MOST_TAPS = 100_000
"""Forty times the paper's filter; a kernel of this length takes 0.2 GB when it is tabulated."""
MOST_TRANSFORM = 2**24
"""Points of a padded transform: 0.3 GB; the paper takes 2**16."""
MOST_BINS = 2**21
"""Bins of a density, and points of a grid, that fit into 16 MB; finer ones are summed directly."""
MOST_PLACES = 100_000
"""Places at which the distance of two probes is looked for: 6000 of the shortest wavelengths."""
MOST_CARRIED = 2000
"""Places at which a wave is read beforehand: 80 kB a sample of a run."""
MOST_TERMS = 4000
"""Polynomials in the distance of a carried wave: each takes as much memory as the record."""
MOST_PADDING = 10_000_000
"""Samples by which a record is continued at either end: 80 MB each."""
MOST_AHEAD = 1_000_000
"""Samples of waves that are predicted: the prediction fades within some periods."""
MOST_UNROLLED = 100_000
"""Steps of an ONNX graph, which holds each of them: 30 MB, and 0.1 GB while it is made."""
MOST_STEPS = 10_000_000
"""Samples per column of a raw file of the tank, and steps of a simulated run: 80 MB per column."""
MOST_PRODUCTS = 2e10
"""Samples times wave components of the tank: some minutes of work per wave probe."""
MOST_LAGS = 20_000
"""Steps of the tank's radiation kernel."""

FREE = 2**28
"""Bytes that a file may unpack to, for any size of the file."""
EXPANSION = 100
"""Times its own size that a larger file may unpack to; tables of numbers reach 10, constants 50."""


def too_large(asked: str, count: float, most: float, what: str, mend: str) -> str | None:
    """Words for a request beyond its bound; None where it is within, and for NaN it is not."""
    if count <= most:
        return None
    shown = str(count) if isinstance(count, int) and count < 10**9 else f"{float(count):.3g}"
    return f"{asked} {shown} {what}; at most {most:.12g} are allowed. {mend}"


def check_size(
    asked: str, count: float, most: float, what: str, mend: str, long: float = math.inf
) -> None:
    """Refuse what is too large before it takes memory, and warn of what takes long.

    Parameters
    ----------
    asked : str
        The key or argument that asks for it, its value, and a verb: ``"n_members = 9 takes"``.
    count, most : float
        How many of them it takes, and how many are allowed.
    what : str
        What is counted.
    mend : str
        The remedy.
    long : float, optional
        The count from which a warning is given.

    Raises
    ------
    RequestError
        If the count is beyond the most that is allowed.
    """
    if words := too_large(asked, count, most, what, mend):
        raise RequestError(words)
    if count > long:
        warn(f"{asked} {count:.3g} {what}, which takes long. {mend}")


def check_numbers(asked: str, count: float, mend: str, long: float = math.inf) -> None:
    """Refuse, as :func:`check_size`, numbers that take too much memory; stated in MiB."""
    mebibytes = 8 / 2**20
    check_size(asked, mebibytes * count, round(mebibytes * MOST_NUMBERS), "MiB", mend,
               mebibytes * long)  # fmt: skip


def most_bytes(stored: int) -> int:
    """Bytes that so many stored bytes may unpack to."""
    return max(FREE, EXPANSION * stored)


def check_declared(path: Path | str, file: h5py.File, mend: str) -> None:
    """Refuse an HDF5 file whose sets declare far more values than they store.

    A set that was never filled takes no disk, and all of its memory once it is read.

    Parameters
    ----------
    path : Path or str
        What the message calls the file.
    file : h5py.File
        The file, open.
    mend : str
        The remedy.

    Raises
    ------
    DataError
        Of the first set that does, or if all of them together do.
    """
    found: list[tuple[int, int]] = []

    def judge(asked: str, declared: int, stored: int) -> None:
        if declared > most_bytes(stored):
            raise DataError(
                f"{path}: {asked} ({declared / 2**20:.0f} MiB), and {stored / 2**20:.3g} MiB are "
                f"stored: it was never filled, or is damaged. {mend}"
            )

    def look(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if getattr(item, "size", None) is not None:  # no group, and no set without values
            found.append((item.size * item.dtype.itemsize, item.id.get_storage_size()))
            judge(f"'{name}' declares {item.size} values", *found[-1])

    file.visititems(look)
    declared, stored = (sum(each) for each in zip(*found, strict=True)) if found else (0, 0)
    judge(f"its {len(found)} sets declare too much together", declared, stored)
