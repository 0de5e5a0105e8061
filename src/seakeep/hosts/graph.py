"""ONNX graphs of a model: one step, or a forecast of a fixed number of steps."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seakeep.arrays import IntArray, whole_number
from seakeep.core.readouts import LinearHinges
from seakeep.core.recursion import Place
from seakeep.errors import RequestError
from seakeep.files import MARK, check_output, replacing
from seakeep.hosts.program import Program, program_of
from seakeep.models import Model
from seakeep.models.following import Following
from seakeep.models.observables import SLOPE, Formula, Power, Product, SlowSquare, Term

if TYPE_CHECKING:
    import onnx

__all__ = ["write_onnx"]

KIND = "graph for ONNX"
OPSET, IR = 17, 8
"""Versions of the operators and of the file: those of ONNX 1.12, of 2022."""
END = np.iinfo(np.int64).max
INT64 = 7
"""Number of the type in ONNX."""
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

    Its inputs are ``x_history`` (rows, N) and ``u`` (time, Q), oldest row first, in physical
    units: the rows of ``u_history`` and ``u_future`` of :meth:`HankelDMDcModel.forecast_arrays`
    that it needs, one after the other. Its outputs are ``x`` (steps, N) and ``x_after`` (rows, N),
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
    made = _model(program_of(model), int(count))
    onnx.checker.check_model(made, full_check=True)
    with replacing(target) as temporary:
        temporary.write_bytes(made.SerializeToString())
    return target


_Values = list[tuple[str, tuple[int, ...]]]
"""Names of values and their shapes."""


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

    def __call__(self, operator: str, *inputs: Any, into: str = "", **attributes: Any) -> str:
        """Name of the value of an operator; inputs are names or constants."""
        from onnx import helper

        names = [each if isinstance(each, str) else self.constant(each) for each in inputs]
        made = into or f"{self.prefix}value_{len(self.nodes)}"
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
    size, following = signature.state_samples, program.following
    turned = graph("Gather", "x_history", np.arange(size - 1, size - s - 2, -1), axis=0)
    deviations = graph("Div", graph("Sub", turned, scale.mean), scale.std)
    # What is handed from step to step, and what each step takes: names and shapes.
    handed: _Values = [(graph("Reshape", deviations, [extended]), (extended,))]
    taken: _Values = [(_forcing(graph, program, steps), (rows,))]
    before = ["state"]
    if following is not None:
        table, more = _tables(graph, following, program, steps)
        taken.append((table, (following.place.count, program.sizes[0])))
        handed += more
        before += ["surge", "line"]
    after = [f"{name}_after" for name in before]
    added = "forced" if following is None else _followed(step, following, program)
    moved = step("Add", step("MatMul", coefficients[:, :extended], "state"), added)
    kept = step("Slice", "state", [0], [extended - rows])
    step("Concat", moved, kept, into="state_after", axis=0)
    step("Slice", moved, [0], [N], into="newest")
    if following is not None:
        column = following.follows.column
        surge = _column(step, step("Unsqueeze", "newest", [0]), column)
        surge = step("Add", step("Mul", surge, scale.std[column]), scale.mean[column])
        older = step("Slice", "surge", [0], [-1])
        step("Concat", step("Squeeze", surge, [0]), older, into="surge_after", axis=0)
    takes = ["forced", "places"][: len(taken)]
    body = helper.make_graph(
        step.nodes,
        "step",
        [value(name, *shape) for name, (_, shape) in zip(before, handed, strict=True)]
        + [value(name, *shape) for name, (_, shape) in zip(takes, taken, strict=True)],
        [value(name, *shape) for name, (_, shape) in zip(after, handed, strict=True)]
        + [value("newest", N)],
        step.constants,
    )
    scan = helper.make_node(
        "Scan",
        [name for name, _ in handed + taken],
        [f"last_{name}" for name in before] + ["series"],
        body=body,
        num_scan_inputs=len(taken),
    )
    graph.nodes.append(scan)

    x = graph("Add", graph("Mul", "series", scale.std), scale.mean)
    if following is None:  # delayed rows that are regressed are no past
        last = graph("Reshape", "last_state", [s + 1, N])
        last = graph("Gather", last, np.arange(s, -1, -1), axis=0)
        graph("Add", graph("Mul", last, scale.std), scale.mean, into="x_after")
    else:
        graph("Slice", graph("Concat", "x_history", x, axis=0), [steps], [END], [0], into="x_after")
    read = {
        each.column: _hinges(graph, each.function, x)
        for each in signature.readouts
        if each.function is not None
    }
    columns = [read.get(column) or _column(graph, x, column) for column in range(N)]
    graph("Concat", *columns, into="x", axis=1)
    given = [value("x_history", size, N)]
    if signature.inputs:
        length = program.history + signature.lead_samples + steps
        given.append(value("u", length, len(signature.inputs)))
    made = helper.make_graph(
        graph.nodes,
        "forecast",
        given,
        [value("x", steps, N), value("x_after", size, N)],
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


def _forcing(graph: _Nodes, program: Program, steps: int) -> str:
    """What inputs add at each step, (steps, rows); without what the surge drives."""
    signature, coefficients = program.model.signature, program.model.coefficients
    z, now, n = signature.input_delays, program.history, program.sizes[0]
    weights = coefficients[:, len(signature.states) * (signature.state_delays + 1) :]
    groups, parts = [], []
    if signature.inputs and program.following is None:
        terms: list[Term] = [Product((place,)) for place in range(len(signature.inputs))]
        terms += program.terms(True)
        first, count = now - z + program.lead, z + steps
        values = _standardised(graph, program, "delayed", terms, first, count)
        order = np.arange(steps)[:, None] + np.arange(z, -1, -1)
        rows = graph("Gather", values, order, axis=0)
        groups.append(graph("Reshape", rows, [steps, (z + 1) * n]))
        parts.append(weights[:, : (z + 1) * n])
    if still := program.terms(False):
        groups.append(_standardised(graph, program, "direct", still, now, steps))
        parts.append(weights[:, (z + 1) * n :][:, : len(still)])
    if not groups:
        return graph.constant(np.zeros((steps, len(coefficients))))
    return graph("MatMul", graph("Concat", *groups, axis=1), np.concatenate(parts, axis=1).T)


def _standardised(
    graph: _Nodes, program: Program, kind: str, terms: Sequence[Term], first: int, count: int
) -> str:
    """Standardised columns of terms, (count, terms), from the row `first` of the inputs on."""
    rows = graph("Slice", "u", [first], [first + count], [0])
    columns = [
        _slow_square(graph, term, first, count)
        if isinstance(term, SlowSquare)
        else _term(graph, term, rows)
        for term in terms
    ]
    mean, std = (
        each[: len(terms)] for each in (program.scales[kind].mean, program.scales[kind].std)
    )
    return graph("Div", graph("Sub", graph("Concat", *columns, axis=1), mean), std)


def _tables(
    graph: _Nodes, following: Following, program: Program, steps: int
) -> tuple[str, _Values]:
    """Standardised rows of the steps at all places, and what the first step remembers.

    That are the last surges and the rows before the start, both newest first.
    """
    signature, place = program.model.signature, following.place
    z, n, past = signature.input_delays, program.sizes[0], place.taps.size
    count, columns, scale = z + steps, [], program.scales["delayed"]
    samples = program.history - z + np.arange(count)
    banks = {each.column: each for each in program.banks}
    for column in range(len(signature.inputs)):
        total = graph("Gather", _column(graph, "u", column), samples, axis=0)
        total = graph("Expand", total, np.array([count, place.count]))
        if column in banks:
            around = samples[:, None] + np.arange(-following.back, following.ahead + 1)
            total = ""
            for number, probe in enumerate(banks[column].columns):
                record = graph("Squeeze", _column(graph, "u", probe), [1])
                windows = graph("Gather", record, around)
                part = graph("MatMul", windows, banks[column].taps[:, number].T)
                total = graph("Add", total, part) if total else part
        columns.append(graph("Reshape", total, [count * place.count, 1]))
    inputs = graph("Concat", *columns, axis=1)
    terms = [_term(graph, term, inputs) for term in program.terms(True)]
    rows = graph("Concat", inputs, *terms, axis=1)
    rows = graph("Div", graph("Sub", rows, scale.mean), scale.std)
    table = graph("Reshape", rows, [count, place.count, n])
    surge = graph("Squeeze", _column(graph, "x_history", following.follows.column), [1])
    last = signature.state_samples - 1 - np.arange(past)
    before = graph("Gather", surge, last - np.arange(z, 0, -1)[:, None])
    line = _between(graph, place, graph("MatMul", before, place.taps), rows, np.arange(z))
    line = graph("Gather", line, np.arange(z - 1, -1, -1), axis=0)
    remembered: _Values = [
        (graph("Gather", surge, last), (past,)),
        (graph("Reshape", line, [z * n]), (z * n,)),
    ]
    return graph("Slice", table, [z], [END], [0]), remembered


def _followed(step: _Nodes, following: Following, program: Program) -> str:
    """What is added in a step whose waves are read at the place of its surge."""
    signature, place, scale = program.model.signature, following.place, program.scales["direct"]
    on_states = len(signature.states) * (signature.state_delays + 1)
    weights, line = program.model.coefficients[:, on_states:], signature.input_delays
    line = line * program.sizes[0]
    here = step("MatMul", "surge", place.taps[:, None])
    row = _between(step, place, here, "places", np.arange(1))
    driving = step("Concat", step("Squeeze", row, [0]), "line", axis=0)
    step("Slice", driving, [0], [line], into="line_after")
    delayed = step("MatMul", weights[:, : line + program.sizes[0]], driving)
    apart = step("Sub", _clipped(step, place, here), np.array(place.centre))
    square = step("Div", step("Sub", step("Mul", apart, apart), scale.mean[-1]), scale.std[-1])
    return step("Add", step("Add", "forced", delayed), step("Mul", square, weights[:, -1]))


def _clipped(graph: _Nodes, place: Place, here: str) -> str:
    above = graph("Max", here, np.array(place.lowest))
    return graph("Min", above, np.array(place.grid[-1]))


def _between(graph: _Nodes, place: Place, here: str, rows: str, samples: IntArray) -> str:
    """Rows, (samples × places, n), read at a place for each sample; see ``read_table``."""
    apart = graph("Sub", _clipped(graph, place, here), np.array(place.lowest))
    on_grid = graph("Div", apart, np.array(place.spacing))
    below = graph("Min", graph("Floor", on_grid), np.array(place.count - 2.0))
    part = graph("Unsqueeze", graph("Sub", on_grid, below), [1])
    at = graph("Add", graph("Cast", below, to=INT64), samples * place.count)
    lower = graph("Gather", rows, at, axis=0)
    upper = graph("Gather", rows, graph("Add", at, np.array(1)), axis=0)
    return graph("Add", lower, graph("Mul", part, graph("Sub", upper, lower)))


def _column(graph: _Nodes, table: str, place: int) -> str:
    return graph("Slice", table, [place], [place + 1], [1])


def _term(graph: _Nodes, term: Term, rows: str) -> str:
    """Column of a term of the inputs in each row, shape (rows, 1)."""
    assert not isinstance(term, SlowSquare)
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
