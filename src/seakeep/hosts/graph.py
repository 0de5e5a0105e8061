"""ONNX graphs of a model: one step, or a forecast of a fixed number of steps."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seakeep.arrays import whole_number
from seakeep.core.readouts import LinearHinges
from seakeep.errors import RequestError
from seakeep.files import MARK, check_output, replacing
from seakeep.hosts.program import Program, program_of
from seakeep.models import Model
from seakeep.models.observables import SLOPE, Formula, Power, Product, SlowSquare, Term
from seakeep.sizes import MOST_UNROLLED, check_size

if TYPE_CHECKING:
    import onnx

__all__ = ["write_onnx"]

KIND = "graph for ONNX"
OPSET, IR = 17, 8
"""Versions of the operators and of the file: those of ONNX 1.12, of 2022."""
END = np.iinfo(np.int64).max
OPERATORS = {
    "add": "Add",
    "subtract": "Sub",
    "multiply": "Mul",
    "divide": "Div",
    "power": "Pow",
    "negative": "Neg",
    "abs": "Abs",
    "sqrt": "Sqrt",
    "sin": "Sin",
}


def write_onnx(model: Model, path: str | Path, steps: int = 1) -> Path:
    """Write a forecast of a fixed number of steps as an ONNX graph in double precision.

    Its inputs are ``x_history`` (s + 1, N) and ``u`` (time, Q), oldest row first, in physical
    units: the rows of ``u_history`` and ``u_future`` of :meth:`HankelDMDcModel.forecast_arrays`
    that it needs, one after the other. Its outputs are ``x`` (steps, N) and ``x_after`` (s + 1, N),
    the ``x_history`` with which the next call goes on.

    Parameters
    ----------
    model : Model
        As for :func:`seakeep.hosts.write_c`.
    path : str or Path
        File to write; its suffix should be ``.onnx``.
    steps : int, optional
        Number of instants.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RequestError
        If the model cannot be exported, onnx is not installed, or a file is there that seakeep did
        not write.

    Notes
    -----
    A run that diverges is not cut to NaN, as ``forecast_arrays`` does.
    """
    try:
        import onnx
    except ImportError as error:
        raise RequestError(
            "onnx is not installed. Install it with: pip install 'seakeep[onnx]'"
        ) from error
    target = Path(path)
    check_output(target, KIND)
    count = whole_number(steps, "steps")
    check_size("steps: one graph would hold", count, MOST_UNROLLED, "steps", "Export fewer.")
    made = _model(program_of(model), int(count))
    onnx.checker.check_model(made, full_check=True)
    with replacing(target) as temporary:
        temporary.write_bytes(made.SerializeToString())
    return target


class _Nodes:
    """Nodes and constants of a graph as they are added; every value has a name of its own."""

    def __init__(self, dt: float, prefix: str = "") -> None:
        self.dt, self.prefix = dt, prefix
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def constant(self, value: Any) -> str:
        """Name of a constant."""
        from onnx import numpy_helper

        name = f"{self.prefix}constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    def __call__(self, operator: str, *inputs: Any, to: str = "", **attributes: Any) -> str:
        """Name of the value of an operator; inputs are names or constants."""
        from onnx import helper

        names = [each if isinstance(each, str) else self.constant(each) for each in inputs]
        made = to or f"{self.prefix}value_{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, names, [made], **attributes))
        return made


def _model(program: Program, steps: int) -> onnx.ModelProto:
    """The forecast as a graph: regressors of all steps, then a scan over them."""
    from onnx import TensorProto, helper

    def value(name: str, *shape: int) -> onnx.ValueInfoProto:
        return helper.make_tensor_value_info(name, TensorProto.DOUBLE, shape)

    signature, coefficients = program.model.signature, program.model.coefficients
    N, s, scale = len(signature.states), signature.state_delays, signature.state_scale
    rows, extended = len(coefficients), N * (s + 1)
    graph, step = _Nodes(signature.dt), _Nodes(signature.dt, "step_")
    turned = graph("Gather", "x_history", np.arange(s, -1, -1), axis=0)
    deviations = graph("Div", graph("Sub", turned, scale.mean), scale.std)
    start = graph("Reshape", deviations, [extended])
    if signature.inputs:
        regressors = _regressors(graph, program, steps)
        forcing = graph("MatMul", regressors, coefficients[:, extended:].T)
    else:
        forcing = graph.constant(np.zeros((steps, rows)))

    moved = step("Add", step("MatMul", coefficients[:, :extended], "state"), "forced")
    kept = step("Slice", "state", [0], [extended - rows])
    step("Concat", moved, kept, to="next", axis=0)
    step("Slice", moved, [0], [N], to="newest")
    body = helper.make_graph(
        step.nodes,
        "step",
        [value("state", extended), value("forced", rows)],
        [value("next", extended), value("newest", N)],
        step.constants,
    )
    scan = helper.make_node(
        "Scan", [start, forcing], ["last", "series"], body=body, num_scan_inputs=1
    )
    graph.nodes.append(scan)

    last = graph("Gather", graph("Reshape", "last", [s + 1, N]), np.arange(s, -1, -1), axis=0)
    graph("Add", graph("Mul", last, scale.std), scale.mean, to="x_after")
    x = graph("Add", graph("Mul", "series", scale.std), scale.mean)
    read = {
        each.column: _hinges(graph, each.function, x)
        for each in signature.readouts
        if each.function is not None
    }
    columns = [read.get(column) or _column(graph, x, column) for column in range(N)]
    graph("Concat", *columns, to="x", axis=1)
    given = [value("x_history", s + 1, N)]
    if signature.inputs:
        length = program.history + signature.lead_samples + steps
        given.append(value("u", length, len(signature.inputs)))
    made = helper.make_graph(
        graph.nodes,
        "forecast",
        given,
        [value("x", steps, N), value("x_after", s + 1, N)],
        graph.constants,
    )
    model = helper.make_model(
        made,
        doc_string=f"{MARK}: {KIND}. {program.timing}",
        producer_name="seakeep",
        producer_version=metadata.version("seakeep"),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR,
    )
    helper.set_model_props(
        model,
        {
            "states": ", ".join(signature.states),
            "inputs": ", ".join(signature.inputs),
            "dt": repr(signature.dt),
            "lead_samples": str(signature.lead_samples),
        },
    )
    return model


def _regressors(graph: _Nodes, program: Program, steps: int) -> str:
    """Standardised regressors of all steps, newest first, shape (steps, n(z+1) + m)."""
    signature = program.model.signature
    z, now = signature.input_delays, program.history
    places = [Product((place,)) for place in range(len(signature.inputs))]
    groups = []
    for delayed, first, count in ((True, now - z + program.lead, z + steps), (False, now, steps)):
        terms = [*places, *program.terms(True)] if delayed else program.terms(False)
        if not terms:
            continue
        scale = program.scales["delayed" if delayed else "direct"]
        columns = [_term(graph, term, first, count) for term in terms]
        values = graph("Concat", *columns, axis=1)
        values = graph("Div", graph("Sub", values, scale.mean), scale.std)
        if delayed:
            order = np.arange(steps)[:, None] + np.arange(z, -1, -1)
            values = graph("Gather", values, order, axis=0)
            values = graph("Reshape", values, [steps, (z + 1) * len(terms)])
        groups.append(values)
    return graph("Concat", *groups, axis=1)


def _column(graph: _Nodes, table: str, place: int) -> str:
    return graph("Slice", table, [place], [place + 1], [1])


def _term(graph: _Nodes, term: Term, first: int, count: int) -> str:
    """Column of a term, shape (count, 1), from the row `first` of the inputs on."""
    if isinstance(term, SlowSquare):
        return _slow_square(graph, term, first, count)
    rows = graph("Slice", "u", [first], [first + count], [0])
    if isinstance(term, Formula):
        return term.expression.fold(
            lambda number: graph.constant(np.array([[number]])),
            lambda name: _column(graph, rows, term.places[name]),
            lambda name, values: _operation(graph, name, values),
        )
    if isinstance(term, Power):
        u = value = _column(graph, rows, term.place)
        grown = graph("Add", graph("Div", graph("Mul", u, u), np.array(term.limit)), np.array(1.0))
        calm = graph("Div", u, graph("Sqrt", grown))
        for _ in range(term.power - 1):
            value = graph("Mul", value, calm)
        return value
    value = _column(graph, rows, term.places[0])
    for place in term.places[1:]:
        value = graph("Mul", value, _column(graph, rows, place))
    return value


def _slow_square(graph: _Nodes, term: SlowSquare, first: int, count: int) -> str:
    """Filtered square of a derivative; the filter is a product of rows around each row."""
    u, dt = _column(graph, "u", term.place), graph.dt

    def part(start: int, stop: int) -> str:
        return graph("Slice", u, [start], [stop], [0])

    if term.order == 0:
        value = u
    elif term.order == 1:
        value = graph("Div", graph("Sub", part(2, END), part(0, -2)), np.array(2.0 * dt))
    else:
        twice = graph("Mul", part(1, -1), np.array(2.0))
        ends = graph("Add", part(2, END), part(0, -2))
        value = graph("Div", graph("Sub", ends, twice), np.array(dt**2))
    half = len(term.kernel) // 2
    around = np.arange(count)[:, None] + np.arange(-half, half + 1)
    around += first + term.shift - (term.order > 0)
    square = graph("Squeeze", graph("Mul", value, value), [1])
    # A convolution runs backwards.
    slow = graph("MatMul", graph("Gather", square, around, axis=0), term.kernel[::-1, None])
    if not np.isfinite(term.top):
        return slow
    over = graph("Max", graph("Sub", slow, np.array(term.top)), np.array(0.0))
    return graph("Sub", slow, graph("Mul", over, np.array(1.0 - SLOPE)))


def _operation(graph: _Nodes, name: str, values: list[str]) -> str:
    """Operation of an expression."""
    if name == "square":
        return graph("Mul", values[0], values[0])
    if name == "cos":  # onnxruntime knows no cosine in double precision
        return graph("Sin", graph("Add", values[0], np.array(np.pi / 2)))
    if name == "average":
        total = values[0]
        for each in values[1:]:
            total = graph("Add", total, each)
        return graph("Div", total, np.array(float(len(values))))
    return graph(OPERATORS[name], *values)


def _hinges(graph: _Nodes, function: LinearHinges, states: str) -> str:
    """Channel as a function of the states, shape (steps, 1)."""
    columns = [_column(graph, states, column) for column in function.linear]
    for column, knots in zip(function.columns, function.knots, strict=True):
        bent = graph("Sub", _column(graph, states, column), knots[None])
        columns.append(graph("Max", bent, np.array(0.0)))
    value = graph("MatMul", graph("Concat", *columns, axis=1), function.weights[1:, None])
    value = graph("Add", value, np.array(function.weights[0]))
    return graph("Max", value, np.array(function.floor))
