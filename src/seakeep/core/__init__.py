"""Mathematics of the method, on arrays, with NumPy and SciPy only."""

import numpy as np

from seakeep.core.embedding import embed, training_window
from seakeep.core.rollout import rollout
from seakeep.core.solve import Solution, identify

__all__ = [
    "Solution",
    "embed",
    "identify",
    "rollout",
    "training_window",
]

# The C library of Linux hands memory back to the system when more is free than twice the largest
# block that was ever freed, and a fresh page costs as much as the arithmetic on it: a tenth of the
# time of one model, a third of forty windows. Once a block of 16 MiB was freed (no page of it is
# touched), the few megabytes of a fit and of a free run are used again by the next.
np.empty(2**21)
