r"""Many windows of one model from its response to one impulse.

The free runs of :math:`\hat x_{k+1} = \hat A \hat x_k + \hat B \hat u_k` from the state
:math:`\hat x_0` are a sum. Let :math:`v_m` be the state m steps after a unit impulse of one input,
from rest: :math:`v_{m+1} = \hat A v_m + b_m` with :math:`v_0 = 0` and :math:`b_m` the columns of
:math:`\hat B` for the lag m. Were the model at rest before the oldest input that
:math:`\hat u_0` holds, that of the instant −z, it would reach :math:`\xi = \sum_{m=1}^{z} v_m
u_{-m}` at the start, and its outputs would be the convolution of :math:`C v_m` with the inputs. So

.. math:: x_k = C \hat A^k (\hat x_0 - \xi) + \sum_{i=-z}^{k-1} C v_{k-i}\, u_i ,
          \qquad v_{z+1+k} = \hat A^k v_{z+1} .

What depends on the number of windows is a free run without inputs and a convolution, which Fourier
transforms make cheap; no power of :math:`\hat A` meets :math:`\hat B`.

A sum of parts larger than itself loses digits: where the response to an impulse grows beyond
``MOST_GROWTH`` times its size within the delays (a model that is not stable), it is not used.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import fft

from seakeep.core.propagation import doublings, step_cost
from seakeep.core.scratch import LINE, Scratch

__all__ = ["convolve", "grows", "impulse_states", "state_at_rest", "superposition_cost"]

FloatArray = npt.NDArray[np.float64]

MOST_GROWTH = 100.0
"""Two digits of sixteen; a thousandth of the tolerance of results is left."""

TRANSFORM_COST = 8.0
"""Nanoseconds of a number that is Fourier-transformed (rough)."""


def superposition_cost(
    size: int, count: int, channels: int, delays: int, windows: int, steps: int
) -> float:
    """Estimate of the time of free runs by superposition, ns.

    Parameters
    ----------
    size, count, channels, delays : int
        Columns of Â, N, Q and z.
    windows, steps : int
        Windows side by side, and their steps.
    """
    transformed = channels * (windows + count) + windows * count
    return (
        (delays + 1) * step_cost(size, channels)
        + doublings(size, 0, windows + channels, steps)[1]
        + TRANSFORM_COST * transformed * (delays + 2 * steps)
    )


def impulse_states(a: FloatArray, b: FloatArray, channels: int, scratch: Scratch) -> FloatArray:
    r"""States after a unit impulse of each input, from rest.

    Parameters
    ----------
    a, b : ndarray, shapes (N(s+1), N(s+1)) and (N(s+1), Q(z+1))
        Â and B̂.
    channels : int
        Q.
    scratch : Scratch
        Memory; the result is part of it.

    Returns
    -------
    ndarray, shape (z + 1, Q, N(s+1))
        :math:`v_1 … v_{z+1}`.
    """
    size = len(a)
    out = scratch.take((b.shape[1] // channels, channels, size))
    out.reshape(-1, size)[...] = b.T
    # Rows that begin on lines of cache: a quarter of the time of so narrow a product.
    aligned = scratch.take((size, size + (-size) % LINE))[:, :size]
    aligned[...] = a
    moved, transposed = scratch.take((channels, size)), aligned.T
    for before, state in pairwise(out):
        np.matmul(before, transposed, out=moved)
        state += moved
    return out


def state_at_rest(impulse: FloatArray, inputs: FloatArray) -> FloatArray:
    r"""State ξ that the inputs before the start lead to from rest.

    Parameters
    ----------
    impulse : ndarray, shape (z + 1, Q, N(s+1))
        From :func:`impulse_states`.
    inputs : ndarray, shape (window, z + steps, Q)
        Samples, oldest first; sample z is that of the start.

    Returns
    -------
    ndarray, shape (window, N(s+1))
        ξ.
    """
    delays, size = len(impulse) - 1, impulse.shape[2]
    before = np.ascontiguousarray(inputs[:, :delays][:, ::-1]).reshape(len(inputs), -1)
    return np.asarray(before @ impulse[:delays].reshape(-1, size))


def grows(kernel: FloatArray, delays: int) -> bool:
    """Whether a response is much larger after the delays than within them, or not finite.

    Parameters
    ----------
    kernel : ndarray, shape (z + steps, …)
        Outputs after an impulse.
    delays : int
        z.
    """
    within, after = np.abs(kernel[: delays + 1]).max(), np.abs(kernel).max()
    return not after <= MOST_GROWTH * within


def convolve(kernel: FloatArray, inputs: FloatArray, steps: int) -> FloatArray:
    r"""Sums :math:`\sum_{i=-z}^{k-1} h_{k-i}\, u_i` for k = 1 … `steps`.

    Parameters
    ----------
    kernel : ndarray, shape (Q, N, z + steps)
        :math:`h_1, h_2, …` of each input.
    inputs : ndarray, shape (window, z + steps, Q)
        Samples, oldest first.
    steps : int
        Number of sums.

    Returns
    -------
    ndarray, shape (window, N, steps)
        The sums.
    """
    length = kernel.shape[2]
    delays = length - steps
    # Long enough that what wraps around falls on the sums before the start, which nobody reads.
    size = fft.next_fast_len(length + steps - 1, real=True)
    response = fft.rfft(kernel, size)
    driving = fft.rfft(np.ascontiguousarray(inputs[:, :length].transpose(2, 0, 1)), size)
    total = driving[0][:, None] * response[0]
    for channel in range(1, len(response)):
        total += driving[channel][:, None] * response[channel]
    return np.asarray(fft.irfft(total, size))[..., delays : delays + steps]
