r"""Models whose coefficients vary with an attribute of the run, such as a draught.

Means and coefficients are linear in the parameter p, with q = (p − mean)/SD over the snapshots of
the training, :math:`\hat x_{j+1} = (K_0 + q K_1) [\hat x_j; \hat u_j]`. Both matrices are one ridge
regression on the regressors and q times the regressors; its Gram matrix is a sum over the runs of
:math:`[1, q; q, q^2] \otimes C_r`. At a value of the parameter the model is an ordinary one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import compress
from typing import Any

import numpy as np

from seakeep.arrays import Datasets, FloatArray
from seakeep.core.embedding import spread_means
from seakeep.core.solve import Solution, ridge_path
from seakeep.errors import DataError, warn
from seakeep.models.engine import parameter_of
from seakeep.models.inputs import Signature
from seakeep.models.settings import HankelSettings
from seakeep.models.training import TrainingData, system_of


@dataclass(frozen=True, eq=False)
class Variation:
    """How a model varies with its parameter.

    Parameters
    ----------
    slopes : ndarray, shape of the coefficients
        Their change per unit of q.
    shifts : tuple of ndarray
        Changes per unit of q of the means of states, delayed and direct regressors, physical units.
    centre, spread : float
        q is (p − centre)/spread.
    low, high : float
        Range of the parameter in training.
    """

    slopes: FloatArray
    shifts: tuple[FloatArray, ...]
    centre: float
    spread: float
    low: float
    high: float

    def at(
        self, coefficients: FloatArray, signature: Signature, value: float
    ) -> tuple[FloatArray, Signature]:
        """Coefficients and signature of the ordinary model at a value of the parameter."""
        if not self.low <= value <= self.high:
            warn(
                f"{signature.parameter} = {value:g} lies outside the {self.low:g} to "
                f"{self.high:g} of the training: the model extrapolates. Train on a run beyond it."
            )
        q = (value - self.centre) / self.spread
        moved = (
            replace(scale, mean=scale.mean + q * shift)
            for scale, shift in zip(signature.scales, self.shifts, strict=True)
        )
        return coefficients + q * self.slopes, replace(signature.scaled(*moved), parameter="")


def regress_varying(
    data: TrainingData, settings: HankelSettings, parameter: str, values: Sequence[float]
) -> tuple[Solution, TrainingData, Variation]:
    """Regress on the regressors and on q times them.

    Parameters
    ----------
    data : TrainingData
        Gathered runs.
    settings : HankelSettings
        Exact delay rows.
    parameter : str
        Name of the parameter.
    values : sequence of float
        Parameter of each run.

    Returns
    -------
    solution : Solution
        With the coefficients at q = 0.
    data : TrainingData
        With the means at q = 0.
    variation : Variation
        What varies.

    Raises
    ------
    DataError
        If all runs have the same value.
    """
    known, counts = np.array(values), np.array([each.columns for each in data.windows])
    if np.ptp(known) == 0:
        raise DataError(
            f"all runs have {parameter} = {known[0]:g}, so that nothing can be "
            "learnt of it. Train on runs at two values or more, or leave parameter out."
        )
    centre = float(np.average(known, weights=counts))
    spread = float(np.sqrt(np.average((known - centre) ** 2, weights=counts)))
    q = (known - centre) / spread
    series, shifts, scales = [], [], []
    for scale, each in zip(data.signature.scales, data.series, strict=True):
        means = np.stack(
            [
                x[window.first_column : window.last + 1].mean(axis=0)
                for x, window in zip(each, data.windows, strict=True)
            ]
        )
        at_zero, slope = np.average(means, axis=0, weights=counts), (q * counts) @ means
        slope = slope / counts.sum()  # q has mean 0 and mean square 1
        if not settings.standardize:
            at_zero, slope = np.zeros_like(at_zero), np.zeros_like(slope)
        series.append([x - at_zero - part * slope for x, part in zip(each, q, strict=True)])
        shifts.append(slope * scale.std)
        scales.append(replace(scale, mean=scale.mean + at_zero * scale.std))
    gram: Any = 0.0
    right: Any = 0.0
    for run, (window, part) in enumerate(zip(data.windows, q, strict=True)):
        system, both = system_of([[x[run]] for x in series], [window], settings), [1.0, part]
        gram = gram + np.kron(np.outer(both, both), system.whole)
        right = right + np.kron(both, system.right)
    factor = counts.sum() if settings.ridge_scale == "per_snapshot" else 1.0
    ridge = factor * float(settings.ridge)
    parts = np.split(ridge_path(gram, right, [ridge])[0], 2, axis=1)
    size = len(data.signature.states)
    fixed, slopes = (
        spread_means(each, size, settings.state_delays, settings.blocks) for each in parts
    )
    low, high = float(known.min()), float(known.max())
    variation = Variation(slopes, tuple(shifts), centre, spread, low, high)
    signature = replace(data.signature.scaled(*scales), parameter=parameter)
    data = replace(data, signature=signature)
    return Solution(fixed, "primal", ridge, len(gram)), data, variation


def data_by_value(data: TrainingData, runs: Datasets, parameter: str) -> dict[float, TrainingData]:
    """Training data of the runs at each value of a parameter."""
    values = [parameter_of(runs[name], parameter, name) for name in data.names]
    by_run = [each.name for each in fields(data) if each.name != "signature"]
    out = {}
    for value in sorted(set(values)):
        here = [each == value for each in values]
        own: Any = {each: tuple(compress(getattr(data, each), here)) for each in by_run}
        out[value] = replace(data, **own)
    return out
