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
from seakeep.core.embedding import TrainingWindow, embed
from seakeep.core.response import clip_modes
from seakeep.core.rollout import rollout
from seakeep.core.solve import solve
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
    pasts, driving, following, ahead = [], [], [], []
    for y, u, d, window in zip(outputs, inputs, direct, windows, strict=True):
        first, columns = window.first_column, window.columns
        if columns < future:
            raise DataError(
                f"a run of {columns} snapshot pairs is shorter than the future of {future} "
                "samples. Lower future, or give a longer run."
            )
        past = [embed(y, output_delays, first, columns)]
        if input_delays:
            past.append(embed(u, input_delays - 1, first - 1, columns))
        pasts.append(np.concatenate(past))
        drives = np.concatenate([u, d], axis=1)
        driving.append(drives[first : first + columns].T)
        following.append(y[first + 1 : first + 1 + columns].T)
        count = columns - future + 1
        seen = embed(drives, future - 1, first + future - 1, count)
        ahead.append(np.concatenate([seen, embed(y, future - 1, first + future, count)]))
    split = (inputs[0].shape[1] + direct[0].shape[1]) * future
    seen, targets = np.split(np.concatenate(ahead, axis=1), [split])
    known = np.concatenate(
        [past[:, : each.shape[1]] for past, each in zip(pasts, ahead, strict=True)], axis=1
    )
    regressors = np.concatenate([known, seen])
    coefficients = solve(regressors, targets, ridge * regressors.shape[1]).coefficients
    decided = coefficients[:, : len(known)]
    values, vectors = np.linalg.eigh(decided @ (known @ known.T) @ decided.T)
    leading = np.sqrt(np.maximum(values[::-1][:order], 0.0))
    if len(leading) < order or leading[-1] <= 1e-7 * leading[0]:  # rounding of a Gram matrix
        raise DataError(
            f"the past decides fewer than {order} directions of the future. Lower order, raise "
            "future, or train on more data."
        )
    estimator = (vectors[:, ::-1][:, :order] / np.sqrt(leading)).T @ decided
    states = [estimator @ past for past in pasts]
    now = [np.concatenate([x, u])[:, :-1] for x, u in zip(states, driving, strict=True)]
    then = [np.concatenate([x[:, 1:], y[:, :-1]]) for x, y in zip(states, following, strict=True)]
    both = solve(np.concatenate(now, axis=1), np.concatenate(then, axis=1), 0.0).coefficients
    (A, B), (C, D) = (np.split(rows, [order], axis=1) for rows in np.split(both, [order]))
    return StateSpace(clip_modes(A, 1.0)[0], B, C, D, estimator)
