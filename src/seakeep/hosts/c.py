"""C99 sources of a model: a step function and its header, without any dependency."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.core.readouts import LinearHinges
from seakeep.files import MARK, check_output, make_folder, replacing
from seakeep.hosts.program import Program, program_of
from seakeep.models import Model
from seakeep.models.engine import GROWTH, fading
from seakeep.models.observables import Formula, Product, Term

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["content_of", "identifier", "rendered", "sources", "write_c", "write_sources"]

KIND = "C source"
OPERATORS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}
FUNCTIONS = {"power": "pow", "abs": "fabs"}


def write_c(model: Model, folder: str | Path, name: str = "rom") -> list[Path]:
    """Write a model as C99: ``NAME.c`` and ``NAME.h``.

    Parameters
    ----------
    model : Model
        A single linear model. Its observables and read-outs are part of the code; its inputs are
        aligned already (:meth:`HankelDMDcModel.aligned_inputs`).
    folder : str or Path
        Where to write; it is made if it does not exist.
    name : str, optional
        Name of the files, and first part of all public names in them.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    RequestError
        If the model cannot be exported, or a file is there that seakeep did not write.

    Notes
    -----
    Numbers are written in hexadecimal, so that none is rounded. ``cc -std=c99 -Wall -Werror``
    compiles the code without a warning.
    """
    return write_sources(sources(program_of(model), identifier(name)), folder)


def write_sources(texts: Mapping[str, str], folder: str | Path) -> list[Path]:
    """Write C files; raises as :func:`write_c`."""
    targets = {make_folder(Path(folder)) / file: text for file, text in texts.items()}
    for target in targets:
        check_output(target, KIND)
    for target, text in targets.items():
        with replacing(target) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return list(targets)


def identifier(name: str) -> str:
    """Name for C made of that of a file."""
    made = re.sub(r"\W", "_", name, flags=re.ASCII)
    return made if made[:1].isalpha() else f"m_{made}"


def sources(program: Program, name: str) -> dict[str, str]:
    """Text of the C files by their names."""
    content = content_of(program, name)
    return {f"{name}.{end}": rendered(f"model.{end}", **content) for end in ("h", "c")}


def content_of(program: Program, name: str) -> dict[str, Any]:
    """What the templates of C show of a model."""
    signature = program.model.signature
    n, m = program.sizes
    kernels: list[FloatArray] = []
    terms = {delayed: program.terms(delayed) for delayed in (True, False)}
    code = {key: [_term(each, kernels) for each in found] for key, found in terms.items()}
    return {
        "name": name,
        "upper": name.upper(),
        "mark": f"{MARK}: {KIND}, written by seakeep {metadata.version('seakeep')}:",
        "aligned": program.is_aligned,
        "dt": signature.dt,
        "N": len(signature.states),
        "Q": len(signature.inputs),
        "s": signature.state_delays,
        "z": signature.input_delays,
        "n": n,
        "m": m,
        "rows": len(program.model.coefficients),
        "coefficients": program.model.coefficients,
        "scales": program.scales,
        "lead": program.lead,
        "lead_samples": signature.lead_samples,
        "history": program.history,
        "window": program.back + 1 + signature.lead_samples,
        "now": program.back,
        "state_labels": signature.state_labels,
        "input_labels": signature.input_labels,
        "delayed": [*(f"u[{place}]" for place in range(len(signature.inputs))), *code[True]],
        "direct": code[False],
        "kernels": kernels,
        "growth": GROWTH,
        "fade": fading(signature),
        "readouts": [
            {"column": each.column, "code": _hinges(each.function)}
            for each in signature.readouts
            if each.function is not None
        ],
    }


def rendered(template: str, **content: Any) -> str:
    """Text of a template of this room."""
    return _environment().get_template(template).render(**content)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    made = Environment(
        loader=PackageLoader("seakeep.hosts"),
        autoescape=select_autoescape(["xml"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters |= {"hex": _number, "numbers": _numbers, "text": _text}
    return made


def _number(value: float) -> str:
    """A number as C has it, exactly."""
    return float(value).hex() if np.isfinite(value) else ("-" if value < 0 else "") + "INFINITY"


def _numbers(values: FloatArray) -> str:
    """Initialiser of an array; C99 knows none without elements."""
    flat = [_number(value) for value in np.ravel(values)] or ["0.0"]
    return ",\n".join("    " + ", ".join(flat[at : at + 4]) for at in range(0, len(flat), 4))


def _text(value: str) -> str:
    """Literal of C for any text."""
    escaped = re.sub(rb"[^\w /^.-]", lambda found: b"\\%03o" % ord(found[0]), value.encode())
    return f'"{escaped.decode()}"'


def _term(term: Term, kernels: list[FloatArray]) -> str:
    """Expression of C in u, the inputs of the row; a filter is put beside the other ones."""
    if isinstance(term, Product):
        return " * ".join(f"u[{place}]" for place in term.places)
    if isinstance(term, Formula):
        return term.expression.fold(_number, lambda name: f"u[{term.places[name]}]", _operation)
    number = next((k for k, each in enumerate(kernels) if each is term.kernel), len(kernels))
    if number == len(kernels):
        kernels.append(term.kernel)
    middle, half = f"u + ({term.shift}) * Q + {term.place}", len(term.kernel) // 2
    return f"slow_square({middle}, {term.order}, kernel_{number}, {half})"


def _operation(name: str, values: list[str]) -> str:
    """Operation of an expression in C."""
    if name in OPERATORS:
        return f"({values[0]} {OPERATORS[name]} {values[1]})"
    if name == "negative":
        return f"(-{values[0]})"
    if name == "average":
        return f"(({' + '.join(values)}) / {len(values)}.0)"
    if name == "square":
        return f"pow({values[0]}, 2.0)"
    return f"{FUNCTIONS.get(name, name)}({', '.join(values)})"


def _hinges(function: LinearHinges) -> str:
    """Expression of C in the states x."""
    terms = [_number(function.weights[0])]
    states = [f"x[{column}]" for column in function.linear]
    states += [
        f"fmax(x[{column}] - {_number(knot)}, 0.0)"
        for column, knots in zip(function.columns, function.knots, strict=True)
        for knot in knots
    ]
    weights = function.weights[1:]
    terms += [f"{_number(w)} * {state}" for w, state in zip(weights, states, strict=True)]
    return f"fmax({' + '.join(terms)}, {_number(function.floor)})"
