"""ONNX graphs of a model: one step, or a forecast of a fixed number of steps."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from seakeep.arrays import FloatArray, IntArray, whole_number
from seakeep.core.recursion import Place
from seakeep.errors import needing
from seakeep.files import MARK, check_output, replacing, version
from seakeep.hosts.program import exportable, timing
from seakeep.models import HankelDMDcModel, Model
from seakeep.models.alignment import Following
from seakeep.models.inputs import Signature
from seakeep.models.observables import Observed
from seakeep.models.terms import SlowSquare, Term

KIND = "graph for ONNX"
OPSET, IR = 17, 8
"""Versions of the operators and of the file: those of ONNX 1.12, of 2022."""
END = np.iinfo(np.int64).max
INT64 = 7
"""Number of the type in ONNX."""
OPERATORS = {
    "subtract": "Sub",
    "multiply": "Mul",
    "divide": "Div",
    "matmul": "MatMul",
    "power": "Pow",
    "negative": "Neg",
    "absolute": "Abs",
    "maximum": "Max",
    "minimum": "Min",
}
"""Operators of ONNX by the functions of numpy, where they are called otherwise."""


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
    with needing("writing a graph", "onnx"):
        import onnx
    target = Path(path)
    check_output(target, KIND)
    proto = _model(exportable(model), whole_number(steps, "steps"))
    onnx.checker.check_model(proto, full_check=True)
    with replacing(target) as temporary:
        temporary.write_bytes(proto.SerializeToString())
    return target


_Value = Any
"""A value of a graph, which type checkers take for the array that numpy's functions return."""
_Values = dict[str, tuple[_Value, tuple[int, ...]]]
"""Values and their shapes by name."""


class _Graph:
    """Nodes and constants of a graph as they are added; every value has a name of its own."""

    def __init__(self, prefix: str = "") -> None:
        self.prefix = prefix
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def __call__(self, operator: str, *inputs: Any, into: str = "", **attributes: Any) -> _Value:
        """Value of an operator; inputs are values or constants."""
        from onnx import helper, numpy_helper

        names = []
        for each in inputs:
            if not isinstance(each, _Array):
                constant = np.array(each, order="C")
                each = _Array(self, f"{self.prefix}constant_{len(self.constants)}")
                self.constants.append(numpy_helper.from_array(constant, each.name))
            names.append(each.name)
        output = into or f"{self.prefix}value_{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, names, [output], **attributes))
        return _Array(self, output)


@dataclass(eq=False)  # equality is numpy's
class _Array(NDArrayOperatorsMixin):
    """A value of a graph, to which the arithmetic of numpy adds nodes.

    What a model computes in Python, it writes so itself.
    """

    graph: _Graph
    name: str

    def __array_ufunc__(self, function: np.ufunc, method: str, *inputs: Any) -> _Value:
        values = [each if isinstance(each, _Array) else np.asarray(each, float) for each in inputs]
        if function is np.square:
            return self.graph("Mul", *values, *values)
        if function is np.cos:  # onnxruntime knows no cosine in double precision
            return np.sin(values[0] + np.pi / 2)
        name = function.__name__
        return self.graph(OPERATORS.get(name, name.capitalize()), *values)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> _Value:
        assert function is np.concatenate
        return self.graph("Concat", *args[0], **kwargs)

    def __getitem__(self, key: Any) -> _Value:
        """Samples (a slice or indices), or columns where the key is a pair."""
        axis = 0
        if isinstance(key, tuple):
            axis, key = -1, key[1]
        if isinstance(key, slice):
            stop = END if key.stop is None else key.stop
            return self.graph("Slice", self, [key.start or 0], [stop], [axis])
        return self.graph("Gather", self, key, axis=axis)

    def reshape(self, *shape: int) -> _Value:
        """The same values in another shape."""
        return self.graph("Reshape", self, shape)


def _model(model: HankelDMDcModel, steps: int) -> Any:
    """The forecast as a graph: regressors of all steps, then a scan over them."""
    from onnx import TensorProto, helper

    def value(name: str, *shape: int) -> Any:
        return helper.make_tensor_value_info(name, TensorProto.DOUBLE, shape)

    signature, coefficients = model.signature, model.coefficients
    N, s, scale = len(signature.states), signature.state_delays, signature.state_scale
    rows, extended = len(coefficients), N * (s + 1)
    weights = coefficients[:, extended:]
    size, follows = signature.state_samples, signature.input_map.follows
    graph, step = _Graph(), _Graph("step_")
    history, u = _Array(graph, "x_history"), _Array(graph, "u")
    newest_first = scale.deviations(history[np.arange(size - 1, size - s - 2, -1)])
    # What is handed from step to step, and what each step takes: values and shapes.
    handed: _Values = {"state": (newest_first.reshape(extended), (extended,))}
    taken: _Values = {"forced": (_forcing(graph, u, signature, weights, steps), (rows,))}
    added = _Array(step, "forced")
    if follows:
        table, remembered = _tables(graph, u, history, signature, follows, steps)
        taken["places"] = (table, (follows.place.count, len(signature.input_scale.mean)))
        handed |= remembered
        added = _followed(step, signature, follows, weights, added)
    state = _Array(step, "state")
    moved = coefficients[:, :extended] @ state + added
    step("Concat", moved, state[: extended - rows], into="state_after", axis=0)
    newest = step("Slice", moved, [0], [N], [0], into="newest")
    if follows:
        surge = newest * scale.std + scale.mean
        line = [surge[follows.column : follows.column + 1], _Array(step, "surge")[:-1]]
        step("Concat", *line, into="surge_after", axis=0)
    body = helper.make_graph(
        step.nodes,
        "step",
        [value(name, *shape) for name, (_, shape) in (handed | taken).items()],
        [
            *(value(f"{name}_after", *shape) for name, (_, shape) in handed.items()),
            value("newest", N),
        ],
        step.constants,
    )
    scan = helper.make_node(
        "Scan",
        [each.name for each, _ in (handed | taken).values()],
        [*(f"last_{name}" for name in handed), "series"],
        body=body,
        num_scan_inputs=len(taken),
    )
    graph.nodes.append(scan)

    x = _Array(graph, "series") * scale.std + scale.mean
    if not follows:  # delayed rows that are regressed are no past
        last = _Array(graph, "last_state").reshape(s + 1, N)[np.arange(s, -1, -1)]
        graph("Add", last * scale.std, scale.mean, into="x_after")
    else:
        graph("Slice", graph("Concat", history, x, axis=0), [steps], [END], [0], into="x_after")
    columns = {column: x[:, column : column + 1] for column in range(N)}
    for each in signature.readouts:
        if each.acts:
            wave = None
            if each.load:  # elevation and rate at the line, (steps, 2)
                assert follows
                taps = follows.lines(None, (each.load.place,))
                samples = signature.input_history + np.arange(steps)
                wave = _carried(u, samples, follows, taps, follows.placed)
            columns[each.column] = each.read(x, wave).reshape(steps, 1)
    graph("Concat", *columns.values(), into="x", axis=1)
    given = [value("x_history", size, N)]
    if signature.inputs:
        length = signature.input_history + signature.lead_samples + steps
        given.append(value("u", length, len(signature.inputs)))
    graph_proto = helper.make_graph(
        graph.nodes,
        "forecast",
        given,
        [value("x", steps, N), value("x_after", size, N)],
        graph.constants,
    )
    whole = helper.make_model(
        graph_proto,
        doc_string=f"{MARK}: {KIND}. {timing(model)}",
        producer_name="seakeep",
        producer_version=version(),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR,
    )
    words = {
        "dt": repr(signature.dt),
        "lead_samples": str(signature.lead_samples),
        "states": ", ".join(signature.states),
        "inputs": ", ".join(signature.inputs),
    }
    helper.set_model_props(whole, words)
    return whole


def _forcing(
    graph: _Graph, u: _Value, signature: Signature, weights: FloatArray, steps: int
) -> _Value:
    """What inputs add at each step, (steps, rows); without what the surge drives."""
    input_map = signature.input_map
    z, n, observed = signature.input_delays, signature.input_scale.mean.size, input_map.observed
    now = signature.input_history
    groups, parts = [], []
    if signature.inputs and not input_map.follows:
        rows = u[now - z + input_map.lead : now + input_map.lead + steps]
        values = signature.input_scale.deviations(_with_delayed(observed, rows))
        windows = values[np.arange(steps)[:, None] + np.arange(z, -1, -1)]
        groups.append(windows.reshape(steps, (z + 1) * n))
        parts.append(weights[:, : (z + 1) * n])
    if observed.slopes.size:
        terms = [term for each in observed.groups[1] for term in each.terms]
        values = np.concatenate(
            [_column(graph, term, u, now, steps, observed) for term in terms], axis=1
        )
        values = values - (1.0 - observed.slopes) * np.maximum(values - observed.tops, 0.0)
        count, scale = observed.slopes.size, signature.direct_scale
        groups.append((values - scale.mean[:count]) / scale.std[:count])
        parts.append(weights[:, (z + 1) * n :][:, :count])
    if not groups:
        return graph("Identity", np.zeros((steps, len(weights))))
    return np.concatenate(groups, axis=1) @ np.concatenate(parts, axis=1).T


def _with_delayed(observed: Observed, rows: _Value) -> _Value:
    """Inputs beside the columns that take the input delays."""
    terms = [term for each in observed.groups[0] for term in each.terms]
    columns = [term.columns(rows, observed.limits) for term in terms]
    return np.concatenate([rows, *columns], axis=1)


def _column(
    graph: _Graph, term: Term, u: _Value, first: int, count: int, observed: Observed
) -> _Value:
    """Columns of a term without delays from the row `first` of the inputs on, (count, columns).

    A filter is a product of rows around each row.
    """
    if not isinstance(term, SlowSquare):
        return term.columns(u[first : first + count], observed.limits)
    value, dt = u[:, term.place], term.dt
    if term.order == 1:
        value = (value[2:] - value[:-2]) / (2.0 * dt)
    elif term.order == 2:
        value = (value[2:] + value[:-2] - 2.0 * value[1:-1]) / dt**2
    half, shifts = len(term.kernel) // 2, np.array(term.shifts)
    around = np.arange(count)[:, None] + shifts
    around = around[..., None] + np.arange(-half, half + 1) + first - (term.order > 0)
    return np.square(value)[around] @ term.kernel[::-1]  # a convolution runs backwards


def _tables(
    graph: _Graph,
    u: _Value,
    history: _Value,
    signature: Signature,
    follows: Following,
    steps: int,
) -> tuple[_Value, _Values]:
    """Standardised rows of the steps at all places, and what the first step remembers.

    That are the last surges and the rows before the start, both newest first.
    """
    place, z, n = follows.place, signature.input_delays, signature.input_scale.mean.size
    count, columns, past = z + steps, [], place.taps.size
    samples = signature.input_history - z + np.arange(count)
    banks = {each.column: each for each in follows.banks(None)}
    for column in range(len(signature.inputs)):
        total = graph("Expand", u[:, column : column + 1][samples], np.array([count, place.count]))
        if bank := banks.get(column):
            total = _carried(u, samples, follows, bank.taps, bank.columns)
        columns.append(total.reshape(count * place.count, 1))
    rows = _with_delayed(signature.input_map.observed, np.concatenate(columns, axis=1))
    rows = signature.input_scale.deviations(rows)
    surge, last = history[:, follows.column], signature.state_samples - 1 - np.arange(past)
    before = surge[last - np.arange(z, 0, -1)[:, None]]
    line = _between(graph, place, before @ place.taps, rows, np.arange(z))[np.arange(z - 1, -1, -1)]
    return rows.reshape(count, place.count, n)[z:], {
        "surge": (surge[last], (past,)),
        "line": (line.reshape(z * n), (z * n,)),
    }


def _carried(
    u: _Value, samples: IntArray, follows: Following, taps: FloatArray, probes: tuple[int, ...]
) -> _Value:
    """What carriers read off the probes around samples, (samples, columns)."""
    around = samples[:, None] + np.arange(-follows.back, follows.ahead + 1)
    parts = [u[:, at][around] @ taps[:, i].T for i, at in enumerate(probes)]
    return sum(parts[1:], parts[0])


def _followed(
    step: _Graph, signature: Signature, follows: Following, weights: FloatArray, forced: _Value
) -> _Value:
    """What is added in a step whose waves are read at the place of its surge."""
    place, scale = follows.place, signature.direct_scale
    line = signature.input_delays * signature.input_scale.mean.size
    here = _Array(step, "surge") @ place.taps[:, None]
    row = _between(step, place, here, _Array(step, "places"), np.arange(1))
    driving = step("Concat", row.reshape(-1), _Array(step, "line"), axis=0)
    step("Slice", driving, [0], [line], [0], into="line_after")
    square = (np.square(_clipped(place, here) - place.centre) - scale.mean[-1]) / scale.std[-1]
    width = line + signature.input_scale.mean.size
    return forced + weights[:, :width] @ driving + square * weights[:, -1]


def _clipped(place: Place, here: _Value) -> _Value:
    return np.minimum(np.maximum(here, place.lowest), place.grid[-1])


def _between(graph: _Graph, place: Place, here: _Value, rows: _Value, samples: IntArray) -> _Value:
    """Rows, (samples × places, n), read at a place for each sample; see ``read_table``."""
    on_grid = (_clipped(place, here) - place.lowest) / place.spacing
    below = np.minimum(np.floor(on_grid), place.count - 2.0)
    part = graph("Unsqueeze", on_grid - below, [1])
    at = graph("Add", graph("Cast", below, to=INT64), samples * place.count)
    lower, upper = rows[at], rows[graph("Add", at, np.array(1))]
    return lower + part * (upper - lower)
