"""Export of a model as a discrete state-space system, for Python and for MATLAB."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from seakeep.arrays import FloatArray
from seakeep.errors import RequestError
from seakeep.files import MARK, check_output, replacing
from seakeep.models.interface import Signature

if TYPE_CHECKING:
    import control

__all__ = ["check_linear", "initial_state", "matrices", "to_control", "to_mat"]

SYSTEM = "state-space system"
"""What a MATLAB file holds, as its head states it."""

System = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def matrices(
    a_hat: FloatArray, b_hat: FloatArray, signature: Signature
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    r"""A, B, C, D of the system in physical deviations.

    Its state is :math:`[x_k; …; x_{k-s}; u_{k-1}; …; u_{k-z}]`, its input :math:`u_k`, its output
    :math:`x_k`, all less their means.

    Parameters
    ----------
    a_hat, b_hat : ndarray
        All rows of Â and B̂, on standardised deviations.
    signature : Signature
        Of the model.

    Returns
    -------
    A, B, C, D : ndarray
        Shapes (n, n), (n, Q), (N, n), (N, Q) with n = N(s+1) + Qz.

    Raises
    ------
    RequestError
        If the model has no input.
    """
    states, inputs = len(signature.states), len(signature.inputs)
    if inputs == 0:
        raise RequestError(
            "the model has no input, and a state-space system without input cannot be represented "
            "here. Use model.A and model.eigenvalues."
        )
    scale_x = np.tile(signature.state_scale.std, signature.state_delays + 1)
    scale_u = np.tile(signature.input_scale.std, signature.input_delays + 1)
    a = a_hat * scale_x[:, None] / scale_x
    b = b_hat * scale_x[:, None] / scale_u
    extended, line = a.shape[0], inputs * signature.input_delays
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


def check_linear(signature: Signature) -> None:
    """Refuse a model that follows its own surge."""
    if signature.input_map.follows is not None:
        raise RequestError(
            "the model reads the waves where its own surge takes it, which no linear system can "
            "represent. Export C sources, an FMU or an ONNX graph, use forecast_arrays, or fit a "
            "model with alignment surge = 'measured' or 'none'."
        )


def initial_state(signature: Signature, x_history: FloatArray, u_history: FloatArray) -> FloatArray:
    """State of the system of :func:`matrices` at the last row of the histories.

    The histories hold at least s + 1 and z + 1 rows; the input at the instant itself is not part
    of the state.
    """
    check_linear(signature)
    states = (x_history - signature.state_scale.mean)[::-1][: signature.state_delays + 1]
    inputs = (u_history - signature.input_scale.mean)[::-1][1 : signature.input_delays + 1]
    return np.concatenate([states.ravel(), inputs.ravel()])


def to_control(system: System, signature: Signature) -> control.StateSpace:
    """The system for python-control, with the names of inputs and outputs."""
    try:
        import control
    except ImportError as error:
        raise RequestError(
            "python-control is not installed. Install it with: pip install 'seakeep[control]'"
        ) from error
    return control.ss(
        *system, signature.dt, inputs=signature.inputs, outputs=signature.states, name="seakeep"
    )


def to_mat(system: System, signature: Signature, path: str | Path) -> Path:
    """Write the system as a MATLAB v5 file; see ``HankelDMDcModel.to_mat``."""
    from scipy import io

    A, B, C, D = system
    content = {
        "A": A,
        "B": B,
        "C": C,
        "D": D,
        "Ts": signature.dt,
        "InputOffset": signature.input_scale.mean[:, None],
        "OutputOffset": signature.state_scale.mean[:, None],
        "InputName": _cell([label.name for label in signature.input_labels]),
        "OutputName": _cell([label.name for label in signature.state_labels]),
        "InputUnit": _cell([label.units for label in signature.input_labels]),
        "OutputUnit": _cell([label.units for label in signature.state_labels]),
        "StateName": _cell(_state_names(signature)),
        "Notes": "seakeep: x(k+1) = A x(k) + B (u(k) - InputOffset), "
        "y(k) = C x(k) + D (u(k) - InputOffset) + OutputOffset",
    }
    target = Path(path)
    check_output(target, SYSTEM)
    with replacing(target) as temporary, temporary.open("wb") as stream:
        io.savemat(stream, content, do_compression=True, oned_as="column")
        stream.seek(0)  # a text of 116 bytes is the head of a MATLAB file
        stream.write(f"MATLAB 5.0 MAT-file, {MARK}: {SYSTEM}".ljust(116).encode())
    return target


def _state_names(signature: Signature) -> list[str]:
    """Names of the entries of the state, in the order of :func:`matrices`."""
    states, inputs = signature.states, signature.inputs
    delayed = [(name, back) for back in range(signature.state_delays + 1) for name in states]
    delayed += [(name, back) for back in range(1, signature.input_delays + 1) for name in inputs]
    return [f"{name}(k-{back})" if back else f"{name}(k)" for name, back in delayed]


def _cell(texts: list[str]) -> npt.NDArray[np.object_]:
    cell = np.empty((len(texts), 1), dtype=object)
    cell[:, 0] = texts
    return cell
