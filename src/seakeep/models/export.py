"""Export of a model as a discrete state-space system, for Python and for MATLAB."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy import sparse

from seakeep.arrays import FloatArray
from seakeep.errors import RequestError, needing
from seakeep.files import MARK, check_output, replacing
from seakeep.models.engine import Windows
from seakeep.models.inputs import Signature
from seakeep.models.terms import SlowSquare
from seakeep.signals.expressions import Text

if TYPE_CHECKING:
    import control

SYSTEM = "state-space system"
"""What a MATLAB file holds, as its head states it."""

REGRESSORS = (
    "u of the system are regressors of measured inputs i: p(k) is the output of (FilterA, FilterB, "
    "FilterC, FilterD) for the input i(k + Lead); q = Function(p(k)); c(k) is the output of "
    "(SlowA, SlowB, SlowC, SlowD) for the input q(Delayed+1:end); u(k) = [q(1:Delayed); "
    "min(c, Top) + Slope .* max(c - Top, 0)]. Both filters have forgotten their start after as "
    "many samples as they delay."
)
"""How a MATLAB file makes the regressors of a model with observables."""
DIFFERENCE = np.array([1.0, -2.0, 1.0])

System = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
GRID = 400
"""Frequencies at which the gain of an error is computed."""


def matrices(a_hat: FloatArray, b_hat: FloatArray, signature: Signature) -> System:
    r"""A, B, C, D of the system in physical deviations.

    Its state is :math:`[x_k; …; x_{k-s}; v_{k-1}; …; v_{k-z}]`, its input :math:`[v_k; w_k]`, the
    regressors with delays and those without, its output :math:`x_k`, all less their means. Without
    observables :math:`v_k` is the input :math:`u_k`.

    Parameters
    ----------
    a_hat, b_hat : ndarray
        All rows of Â and B̂, on standardised deviations.
    signature : Signature
        Of the model.

    Returns
    -------
    A, B, C, D : ndarray
        Shapes (q, q), (q, n + m), (N, q), (N, n + m) with q = N(s+1) + nz.

    Raises
    ------
    RequestError
        If the model has no input.
    """
    delayed, direct = signature.input_scale.std, signature.direct_scale.std
    states, n, m = len(signature.states), delayed.size, direct.size
    if n == 0:
        raise RequestError(
            "the model has no input, and a state-space system without input cannot be represented "
            "here. Use model.A and model.eigenvalues."
        )
    scale_x = np.tile(signature.state_scale.std, signature.state_delays + 1)
    scale_u = np.concatenate([np.tile(delayed, signature.input_delays + 1), direct])
    a = a_hat * scale_x[:, None] / scale_x
    b = b_hat * scale_x[:, None] / scale_u
    now, before, beside = np.split(b, [n, b.shape[1] - m], axis=1)
    line = before.shape[1]
    A = np.block([[a, before], [np.zeros((line, len(a))), np.eye(line, k=-n)]])
    B = np.block([[now, beside], [np.eye(line, n), np.zeros((line, m))]])
    return A, B, np.eye(states, len(A)), np.zeros((states, n + m))


def observables(signature: Signature) -> dict[str, Any]:
    """Observables for MATLAB: a filter of the inputs, a function of instants, and a filter of that.

    Parameters
    ----------
    signature : Signature
        Of a model with observables.

    Returns
    -------
    dict
        Contents of the file; :data:`REGRESSORS` says how they make the regressors.
    """
    observed = signature.input_map.observed
    count, lead = len(signature.inputs), signature.lead_samples
    first = []  # weights of one output of the first filter, (sample back, input)
    for back in (lead - signature.input_map.lead, lead):
        first += [{(back, place): 1.0} for place in range(count)]
    every = [
        Text(f"p({place + 1})", power="({0} ^ {1})", absolute="abs") for place in range(2 * count)
    ]
    ahead, now = (np.array([each], dtype=object) for each in (every[:count], every[count:]))
    delayed, direct, second = list(map(str, every[:count])), list[str](), []
    for each, bound in zip(observed.observables, observed.bound, strict=True):
        for term in bound.terms:
            if not isinstance(term, SlowSquare):
                texts = term.columns(ahead if each.delayed else now, observed.limits)[0]
                if not each.delayed:
                    second += [{(0, len(direct) + at): 1.0} for at in range(len(texts))]
                (delayed if each.delayed else direct).extend(map(str, texts))
                continue
            weights = ((1.0,), (0.5 / term.dt, 0.0, -0.5 / term.dt), DIFFERENCE / term.dt**2)
            parts = enumerate(weights[term.order])
            first.append({(back, term.place): float(weight) for back, weight in parts})
            half, newest = len(term.kernel) // 2, lead - (term.order > 0)
            for shift in term.shifts:
                taps = enumerate(term.kernel[::-1].tolist(), start=-half)
                second.append({(newest - shift - at, len(direct)): tap for at, tap in taps})
            direct.append(f"p({len(first)})^2")
    return {
        "Function": f"@(p) [{'; '.join(delayed + direct)}]",
        "Delayed": len(delayed),
        "Top": np.array(observed.tops)[:, None],
        "Slope": observed.slopes[:, None],
        **_shifted("Filter", first, count),
        **_shifted("Slow", second, len(direct)),
        "Regressors": REGRESSORS,
    }


def _shifted(name: str, rows: list[dict[tuple[int, int], float]], inputs: int) -> dict[str, Any]:
    """State space of sums over the last samples: weights by (sample back, input) of each output."""
    length = max((back for row in rows for back, _ in row), default=0)
    weights = np.zeros((len(rows), length + 1, inputs))
    for row, taps in zip(weights, rows, strict=True):
        for at, weight in taps.items():
            row[at] = weight
    size = length * inputs
    return {
        f"{name}A": sparse.eye_array(size, k=-min(inputs, size), format="csc"),
        f"{name}B": sparse.eye_array(size, inputs, format="csc"),
        f"{name}C": weights[:, 1:].reshape(len(rows), size),
        f"{name}D": weights[:, 0],
    }


def check_linear(signature: Signature) -> None:
    """Refuse a model that follows its own surge, or whose means are not fixed."""
    signature.check_fixed()
    if signature.input_map.follows is not None:
        raise RequestError(
            "the model reads the waves where its own surge takes it, which no linear system can "
            "represent. Export C sources, an FMU (for Simulink too) or an ONNX graph, use "
            "forecast_arrays, or fit a model with alignment surge = 'measured' or 'none'."
        )


def initial_state(signature: Signature, windows: Windows) -> FloatArray:
    """State of the system of :func:`matrices` at the start of a forecast of one step.

    The input at the instant itself is not part of the state.
    """
    check_linear(signature)
    states = (windows.histories[0] - signature.state_scale.mean)[::-1]
    inputs = (windows.delayed[0] - signature.input_scale.mean)[::-1]
    states, inputs = states[: signature.state_delays + 1], inputs[1 : signature.input_delays + 1]
    return np.concatenate([states.ravel(), inputs.ravel()])


def to_control(system: System, signature: Signature) -> control.StateSpace:
    """The system for python-control, with the names of inputs and outputs."""
    with needing("a system of python-control", "control"):
        import control
    return control.ss(
        *system, signature.dt, inputs=signature.inputs, outputs=signature.states, name="seakeep"
    )


def truncated(system: System, signature: Signature, order: int) -> tuple[System, float, float]:
    r"""Balanced truncation of a system, the largest gain of its error, and a bound of that.

    Inputs and outputs count in their SDs of training. The largest gain of the error at any
    frequency is at most :math:`2\sum_{i>r} \sigma_i` of the Hankel singular values that are left
    out (Glover 1984; Al-Saggaf and Franklin 1987 for discrete time). The bound counts each of them
    as if all peaked at one frequency; the gain itself is computed on a grid and at each mode.

    Raises
    ------
    RequestError
        If the order is not below that of the system, or this is not stable.
    """
    from scipy import linalg

    a, b, c, d = system
    if not 0 < order < len(a):
        raise RequestError(f"order is {order}; it must lie between 1 and {len(a) - 1}.")
    if (radius := float(np.abs(linalg.eigvals(a)).max())) >= 1.0:
        raise RequestError(
            f"the model has an eigenvalue of modulus {radius:.6g}, and balanced truncation takes a "
            "stable one. Fit it with stable = true, or export all of it."
        )
    inputs = np.concatenate([signature.input_scale.spread, signature.direct_scale.spread])
    gains = b * inputs, (c / signature.state_scale.spread[:, None]).T

    def root(matrix: FloatArray, gain: FloatArray) -> FloatArray:
        values, vectors = linalg.eigh(linalg.solve_discrete_lyapunov(matrix, gain @ gain.T))
        return vectors * np.sqrt(np.maximum(values, 0.0))

    reached, seen = root(a, gains[0]), root(a.T, gains[1])
    u, sigma, v = linalg.svd(seen.T @ reached)
    scale = np.sqrt(sigma[:order])
    left, right = (seen @ u[:, :order] / scale).T, reached @ v[:order].T / scale
    reduced = left @ a @ right
    # Of the difference of both systems, in a form that is fast at each frequency.
    upper, basis = linalg.schur(linalg.block_diag(a, reduced), output="complex")
    drive = basis.conj().T @ np.concatenate([gains[0], left @ gains[0]])
    read = np.concatenate([gains[1], -right.T @ gains[1]]).T @ basis
    # A narrow mode peaks near the angle of its eigenvalue, between the lines of the grid.
    angles = np.append(np.linspace(0.0, np.pi, GRID), np.abs(np.angle(np.diag(upper))))
    turns = np.exp(1j * angles)
    errors = [read @ linalg.solve_triangular(z * np.eye(len(upper)) - upper, drive) for z in turns]
    peak = np.linalg.norm(errors, 2, axis=(1, 2)).max()
    return (reduced, left @ b, c @ right, d), peak, 2.0 * float(sigma[order:].sum())


def to_mat(
    system: System, signature: Signature, path: str | Path, order: int | None = None
) -> Path:
    """Write the system as a MATLAB v5 file; see ``HankelDMDcModel.to_mat``."""
    from scipy import io

    more = dict[str, Any]()
    if order is not None:
        system, peak, bound = truncated(system, signature, order)
        more = {
            "ErrorPeak": peak,
            "ErrorBound": bound,
            "StateName": _cell([f"balanced {i + 1}" for i in range(order)]),
        }
    labels = [
        each for group in signature.input_map.regressors(signature.input_labels) for each in group
    ]
    means = [signature.input_scale.mean, signature.direct_scale.mean]
    content = {
        **dict(zip("ABCD", system, strict=True)),
        "Ts": signature.dt,
        "Lead": signature.lead_samples,
        "InputOffset": np.concatenate(means)[:, None],
        "OutputOffset": signature.state_scale.mean[:, None],
        "InputName": _cell(signature.regressors),
        "OutputName": _cell(signature.states),
        "InputUnit": _cell([label.units for label in labels]),
        "OutputUnit": _cell([label.units for label in signature.state_labels]),
        "StateName": _cell(_state_names(signature)),
        "Notes": "seakeep: x(k+1) = A x(k) + B (u(k) - InputOffset), "
        "y(k) = C x(k) + D (u(k) - InputOffset) + OutputOffset; u(k) are inputs of k + Lead",
        **(observables(signature) if signature.input_map.observed.observables else {}),
        **more,
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
    inputs = [label.name for label in signature.input_map.regressors(signature.input_labels)[0]]
    delayed = [
        (name, back) for back in range(signature.state_delays + 1) for name in signature.states
    ]
    delayed += [(name, back) for back in range(1, signature.input_delays + 1) for name in inputs]
    return [f"{name}(k-{back})" if back else f"{name}(k)" for name, back in delayed]


def _cell(texts: list[str]) -> npt.NDArray[np.object_]:
    cell = np.empty((len(texts), 1), dtype=object)
    cell[:, 0] = texts
    return cell
