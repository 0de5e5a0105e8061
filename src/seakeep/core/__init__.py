"""The mathematics of the method: arrays in, arrays out, numpy and scipy only."""

from seakeep.core.embedding import embed, snapshot_matrices, training_window, unembed
from seakeep.core.regression import Solution, identify
from seakeep.core.rollout import rollout

__all__ = [
    "Solution",
    "embed",
    "identify",
    "rollout",
    "snapshot_matrices",
    "training_window",
    "unembed",
]
