"""What a model was identified from, and how."""

from __future__ import annotations

from dataclasses import dataclass

from seakeep.core.solve import Method

__all__ = ["Training"]


@dataclass(frozen=True)
class Training:
    """What a model was identified from, and how.

    Parameters
    ----------
    runs : tuple of str
        Names of the runs.
    first, stop : tuple of float
        First and last instant of the training window of each run, s.
    columns : tuple of int
        Snapshot pairs each run contributed.
    method : {"primal", "dual", "svd"}
        The form of the regression that was solved.
    ridge : float
        Effective λ.
    rank : int
        Singular values used.
    """

    runs: tuple[str, ...]
    first: tuple[float, ...]
    stop: tuple[float, ...]
    columns: tuple[int, ...]
    method: Method
    ridge: float
    rank: int
