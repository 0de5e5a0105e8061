"""The mathematics of the method: arrays in, arrays out, numpy and scipy only."""

from seakeep.core.embedding import embed, snapshot_matrices, training_window, unembed
from seakeep.core.rollout import rollout
from seakeep.core.solve import Solution, identify

__all__ = [
    "Solution",
    "embed",
    "identify",
    "rollout",
    "snapshot_matrices",
    "training_window",
    "unembed",
]
