"""Export of a model as a discrete state-space system, for Python and for MATLAB."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from seakeep.errors import RequestError
from seakeep.files import replacing

if TYPE_CHECKING:
    import control

    from seakeep.models.model import HankelDMDcModel

__all__ = ["initial_state", "matrices", "to_control", "to_mat"]

FloatArray = npt.NDArray[np.float64]


def matrices(model: HankelDMDcModel) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    r"""A, B, C, D of the system in physical deviations.

    Its state is :math:`[x_k; …; x_{k-s}; u_{k-1}; …; u_{k-z}]`, its input :math:`u_k`, its output
    :math:`x_k`, all less their means.

    Parameters
    ----------
    model : HankelDMDcModel
        The model.

    Returns
    -------
    A, B, C, D : ndarray
        Shapes (n, n), (n, Q), (N, n), (N, Q) with n = N(s+1) + Qz.

    Raises
    ------
    RequestError
        If the model has no input.
    """
    states, inputs = len(model.states), len(model.inputs)
    if inputs == 0:
        raise RequestError(
            "the model has no input, and a state-space system without input cannot be represented "
            "here. Use model.A and model.eigenvalues."
        )
    scale_x = np.tile(model.state_std, model.state_delays + 1)
    scale_u = np.tile(model.input_std, model.input_delays + 1)
    a = model.A * scale_x[:, None] / scale_x
    b = model.B * scale_x[:, None] / scale_u
    extended, line = a.shape[0], inputs * model.input_delays
    size = extended + line
    A = np.zeros((size, size))
    A[:extended, :extended] = a
    A[:extended, extended:] = b[:, inputs:]
    B = np.zeros((size, inputs))
    B[:extended] = b[:, :inputs]
    if line:
        A[extended + inputs :, extended : size - inputs] = np.eye(line - inputs)
        B[extended : extended + inputs] = np.eye(inputs)
    return A, B, np.eye(states, size), np.zeros((states, inputs))


def initial_state(
    model: HankelDMDcModel, x_history: FloatArray, u_history: FloatArray
) -> FloatArray:
    """State of the system of :func:`matrices` at the last row of the histories.

    Parameters
    ----------
    model : HankelDMDcModel
        The model.
    x_history, u_history : ndarray, shape (at least max(s, z) + 1, channel)
        Samples up to the instant, physical units.

    Returns
    -------
    ndarray, shape (N(s+1) + Qz,)
        The state. The input at the instant itself is not part of it.
    """
    states = (x_history - model.state_mean)[::-1][: model.state_delays + 1]
    inputs = (u_history - model.input_mean)[::-1][1 : model.input_delays + 1]
    return np.concatenate([states.ravel(), inputs.ravel()])


def to_control(model: HankelDMDcModel) -> control.StateSpace:
    """The system for python-control, with the names of inputs and outputs."""
    try:
        import control
    except ImportError as error:
        raise RequestError(
            "python-control is not installed. Install it with: pip install 'seakeep[control]'"
        ) from error
    return control.ss(
        *matrices(model), model.dt, inputs=model.inputs, outputs=model.states, name="seakeep"
    )


def to_mat(model: HankelDMDcModel, path: str | Path) -> Path:
    """Write the system as a MATLAB v5 file; see ``HankelDMDcModel.to_mat``."""
    from scipy import io

    A, B, C, D = matrices(model)
    content = {
        "A": A,
        "B": B,
        "C": C,
        "D": D,
        "Ts": model.dt,
        "InputOffset": model.input_mean[:, None],
        "OutputOffset": model.state_mean[:, None],
        "InputName": _cell([label.name for label in model.input_labels]),
        "OutputName": _cell([label.name for label in model.state_labels]),
        "InputUnit": _cell([label.units for label in model.input_labels]),
        "OutputUnit": _cell([label.units for label in model.state_labels]),
        "StateName": _cell(_state_names(model)),
        "Notes": "seakeep: x(k+1) = A x(k) + B (u(k) - InputOffset), "
        "y(k) = C x(k) + D (u(k) - InputOffset) + OutputOffset",
    }
    with replacing(Path(path)) as temporary, temporary.open("wb") as stream:
        io.savemat(stream, content, do_compression=True, oned_as="column")
    return Path(path)


def _state_names(model: HankelDMDcModel) -> list[str]:
    """Names of the entries of the state, in the order of :func:`matrices`."""
    delayed = [(name, back) for back in range(model.state_delays + 1) for name in model.states]
    delayed += [(name, back) for back in range(1, model.input_delays + 1) for name in model.inputs]
    return [f"{name}(k-{back})" if back else f"{name}(k)" for name, back in delayed]


def _cell(texts: list[str]) -> npt.NDArray[np.object_]:
    cell = np.empty((len(texts), 1), dtype=object)
    cell[:, 0] = texts
    return cell
