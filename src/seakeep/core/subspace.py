r"""State-space models by subspace identification (N4SID).

The model is :math:`z_{j+1} = A z_j + B u_j`, :math:`y_{j+1} = C z_j + D u_j`. With the past
:math:`Z_j = [y_j; …; y_{j-s}; u_{j-1}; …; u_{j-z}]`, the future inputs :math:`U_j = [u_j; …;
u_{j+f-1}]` and outputs :math:`Y_j = [y_{j+1}; …; y_{j+f}]`, the regression :math:`Y = L_z Z + L_u
U` gives the part :math:`L_z Z` of the future that the past decides (the oblique projection). Its
leading singular vectors span the states: :math:`z_j = S^{-1/2} P^T L_z Z_j`, a filter of the past.
A second regression gives A, B, C and D. (Van Overschee and De Moor, 1994.) Modes of A that grow,
as those of noise do where the states are more than the data decide, are moved onto the unit circle.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.core.embedding import Delayed, TrainingWindow, lagged_response, primal_system
from seakeep.core.rollout import rollout
from seakeep.core.solve import by_singular_values, clip_modes, ridge_path
from seakeep.errors import DataError


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A state-space model, and the filter that finds its state.

    Parameters
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n, Q + d), (N, n), (N, Q + d)
        Matrices, with d direct inputs.
    filter : ndarray, shape (n, N(s+1) + Q z)
        Maps the past [y_j; …; y_{j−s}; u_{j−1}; …; u_{j−z}] to the state z_j.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    filter: FloatArray

    def free_runs(
        self,
        outputs: FloatArray,
        inputs: FloatArray,
        direct: FloatArray,
    ) -> FloatArray:
        """Free runs over several windows.

        Parameters
        ----------
        outputs : ndarray, shape (window, s + 1, N)
            Outputs up to each start, oldest first.
        inputs : ndarray, shape (window, z + steps, Q)
            Inputs, oldest first; sample z is that of the start.
        direct : ndarray, shape (window, steps, d)
            Further inputs, from the start on, which the filter of the past does not read.

        Returns
        -------
        ndarray, shape (window, steps, N)
            Outputs at the instants after each start.
        """
        count, delays = len(outputs), inputs.shape[1] - direct.shape[1]
        past = [outputs[:, ::-1].reshape(count, -1), inputs[:, :delays][:, ::-1].reshape(count, -1)]
        start = np.concatenate(past, axis=1) @ self.filter.T
        driving = np.concatenate([inputs[:, delays:], direct], axis=2)
        after = rollout(self.A, self.B, start, driving)
        states = np.concatenate([start[:, None], after[:, :-1]], axis=1)
        return states @ self.C.T + driving @ self.D.T


def identify_subspace(
    outputs: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    direct: Sequence[FloatArray],
    windows: Sequence[TrainingWindow],
    *,
    order: int,
    output_delays: int,
    input_delays: int,
    future: int,
    ridge: float,
) -> StateSpace:
    """Identify a state-space model from one or several runs.

    Parameters
    ----------
    outputs : sequence of ndarray, each (time, N)
        Outputs of the runs, standardised.
    inputs : sequence of ndarray, each (time, Q)
        Their inputs.
    direct : sequence of ndarray, each (time, d)
        Further inputs, which the filter of the past does not read.
    windows : sequence of TrainingWindow
        The samples of each run that train; a pair is an instant and the next.
    order : int
        Number of states n, at most N times `future`.
    output_delays, input_delays : int
        s and z, how far back the past reaches.
    future : int
        f, instants of the future.
    ridge : float
        λ of the first regression per column, for inputs that nearly predict their own future.

    Returns
    -------
    StateSpace
        The model.

    Raises
    ------
    DataError
        If the past decides fewer than `order` directions of the future.
    """
    s, z, f = output_delays, input_delays, future
    for window in windows:
        if window.columns < f:
            raise DataError(
                f"a run of {window.columns} snapshot pairs is shorter than the future of {f} "
                "samples. Lower future, or give a longer run."
            )
    # Past and future are one delayed series, as seen from the last instant of the future.
    y = [np.pad(each, ((0, 1), (0, 0))) for each in outputs]
    u, d = ([np.pad(each, ((1, 0), (0, 0))) for each in series] for series in (inputs, direct))
    ends = [TrainingWindow(w.first, w.last + 1, w.first_column + f) for w in windows]
    series = Delayed(y, [(y, f + s), (u, f + z - 1), (d, f - 1)], ends)
    gram = primal_system(series).whole
    N, Q = y[0].shape[1], u[0].shape[1]
    stops = np.cumsum([N * f, N * (s + 1), Q * f, Q * z])
    targets, ys, us, earlier, ds = np.split(np.arange(len(gram)), stops)
    past = np.concatenate([ys, earlier])
    both = np.concatenate([past, us, ds])
    (coefficients,) = ridge_path(
        gram[np.ix_(both, both)], gram[np.ix_(targets, both)], [ridge * series.columns]
    )
    decided = coefficients[:, : past.size]
    values, vectors = np.linalg.eigh(decided @ gram[np.ix_(past, past)] @ decided.T)
    leading = np.sqrt(np.maximum(values[::-1][:order], 0.0))
    if len(leading) < order or leading[-1] <= 1e-7 * leading[0]:  # rounding of a Gram matrix
        raise DataError(
            f"the past decides fewer than {order} directions of the future. Lower order, raise "
            "future, or train on more data."
        )
    estimator = (vectors[:, ::-1][:, :order] / np.sqrt(leading)).T @ decided
    of_outputs, of_inputs = np.split(estimator, [ys.size], axis=1)
    now, then = [], []
    for x, u_run, d_run, w in zip(outputs, inputs, direct, windows, strict=True):
        states = _filtered(x, of_outputs, w.first_column, w.columns)
        if earlier.size:
            states += _filtered(u_run, of_inputs, w.first_column - 1, w.columns)
        drive = np.concatenate([u_run, d_run], axis=1)[w.first_column : w.last - 1].T
        now.append(np.concatenate([states[:, :-1], drive]))
        then.append(np.concatenate([states[:, 1:], x[w.first_column + 1 : w.last].T]))
    pairs = np.concatenate(now, axis=1), np.concatenate(then, axis=1)
    both = by_singular_values(*pairs).coefficients
    (A, B), (C, D) = (np.split(rows, [order], axis=1) for rows in np.split(both, [order]))
    return StateSpace(clip_modes(A, 1.0)[0], B, C, D, estimator)


def _filtered(series: FloatArray, filters: FloatArray, first: int, count: int) -> FloatArray:
    """Delayed samples times each row of filters, shape (row, count)."""
    return np.array([lagged_response(series, each, first, count) for each in filters])
