"""The paper's formula written out in plain NumPy: the oracle of accuracy and the unit of time.

Hankel matrices and the forcing of all steps are built once, the regularised normal equations are
solved by Cholesky, and the free run is a loop over the extended state. Nothing is shared with the
package.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg


def hankel(series: np.ndarray, delays: int, first: int, count: int) -> np.ndarray:
    """Extended snapshots as columns, newest block first."""
    return np.concatenate([series[first - d : first - d + count].T for d in range(delays + 1)])


def fit(
    states: np.ndarray,
    inputs: np.ndarray,
    stop: int,
    *,
    m: int,
    s: int,
    z: int,
    ridge: float,
    history: str = "before",
):
    """Means, deviations and [A B] of the window of m snapshots that ends at sample `stop`.

    Returns
    -------
    tuple
        (x mean, x std, u mean, u std, A, B).
    """
    first = stop - m + 1
    window = slice(first, stop + 1)
    x_mean, x_std = states[window].mean(axis=0), states[window].std(axis=0, ddof=1)
    u_mean, u_std = inputs[window].mean(axis=0), inputs[window].std(axis=0, ddof=1)
    x, u = (states - x_mean) / x_std, (inputs - u_mean) / u_std
    start = first + max(s, z) if history == "inside" else first
    count = stop - start
    y = np.concatenate([hankel(x, s, start, count), hankel(u, z, start, count)])
    after = hankel(x, s, start + 1, count)
    gram = y @ y.T + ridge * np.eye(len(y))
    g = linalg.cho_solve(linalg.cho_factor(gram), y @ after.T).T
    size = len(after)
    return x_mean, x_std, u_mean, u_std, g[:, :size], g[:, size:]


def forecast(model, states: np.ndarray, inputs: np.ndarray, start: int, steps: int) -> np.ndarray:
    """Free run of `steps` from sample `start`; shape (steps, N), physical units."""
    x_mean, x_std, u_mean, u_std, a, b = model
    n, q = states.shape[1], inputs.shape[1]
    s, z = a.shape[1] // n - 1, b.shape[1] // q - 1
    x = (states[start - s : start + 1] - x_mean) / x_std
    u = (inputs[start - z : start + steps] - u_mean) / u_std
    forcing = b @ hankel(u, z, z, steps)
    state = x[::-1].ravel()
    out = np.empty((steps, n))
    for k in range(steps):
        state = a @ state + forcing[:, k]
        out[k] = state[:n]
    return out * x_std + x_mean
