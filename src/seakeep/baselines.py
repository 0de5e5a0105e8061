"""Models to compare with: see :mod:`seakeep.models.baselines`."""

from seakeep.models.baselines import ARX, FIR, HoldLast, Mean, Subspace

__all__ = ["ARX", "FIR", "HoldLast", "Mean", "Subspace"]
