"""Sizes, judged before the work: what a request would take, and the most that is allowed.

Bounds are of requests that no measurement needs, not of machines: the same file is refused
everywhere.
"""

from __future__ import annotations

import math

from seakeep.errors import RequestError, warn

MOST_NUMBERS = 250_000_000
"""Numbers that a run, or the redrawn series of a bootstrap, hold at once: 1907 MiB."""
LONG_NUMBERS = 50_000_000
"""Numbers of a run that take some minutes to prepare."""
LONG_MATRIX = 3000**2
"""Numbers of a model's matrix whose eigenvalues take a minute."""
LEAST_PERIODS, MOST_PERIODS = 1e-6, 1e6
"""Encounter periods of a free run, and seconds of one: beyond them numbers of samples overflow."""
MOST_CELLS, LONG_CELLS = 100_000_000, 1_000_000
"""Forecasts of a study, each of some milliseconds: a week of work, or hours."""
MOST_SERIES = 100_000
"""Redrawn series of a study: 400 MB of densities."""
MOST_TAPS = 100_000
"""Forty times the paper's filter; a kernel of this length takes 0.2 GB when it is tabulated."""
MOST_BINS = 2**21
"""Bins of a density, and points of a grid, that fit into 16 MB; finer ones are summed directly."""
MOST_PLACES = 100_000
"""Places at which the distance of two probes is looked for: 6000 of the shortest wavelengths."""
MOST_CARRIED = 2000
"""Places at which a wave is read beforehand: 80 kB a sample of a run."""
MOST_TERMS = 4000
"""Polynomials in the distance of a carried wave: each takes as much memory as the record."""


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
