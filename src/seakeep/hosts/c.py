"""C99 sources of a model and of its estimator, without any dependency."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from seakeep.arrays import FloatArray
from seakeep.core.readouts import SOFT
from seakeep.files import MARK, check_output, make_folder, templates, version, write_text
from seakeep.hosts.program import exportable
from seakeep.models import HankelDMDcModel, Model, validity
from seakeep.models.engine import GROWTH, fading
from seakeep.models.forecasts import DOUBTED
from seakeep.models.live import AFTER, Live
from seakeep.models.terms import SlowSquare, Term
from seakeep.signals import prediction
from seakeep.signals.expressions import Text
from seakeep.waves import GRAVITY

KIND = "C source"


def write_c(model: Model, folder: str | Path, name: str = "rom") -> list[Path]:
    """Write a model as C99: ``NAME.c`` and ``NAME.h``.

    Parameters
    ----------
    model : Model
        A single linear model. Its carriers, observables and read-outs are part of the code.
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
    return _written(sources(exportable(model), identifier(name)), folder)


def write_estimator(
    model: Model,
    folder: str | Path,
    name: str = "rom",
    noise: Mapping[str, float] | None = None,
    roles: Mapping[str, str] | None = None,
) -> list[Path]:
    """Write a model and its estimator as C99: the files of ``write_c``, and ``NAME_estimator.…``.

    Parameters
    ----------
    model : Model
        As for :func:`seakeep.hosts.write_c`.
    folder, name
        As for :func:`seakeep.hosts.write_c`.
    noise, roles : mapping, optional
        As for ``model.live``; a known input stays at its last value where no plan is given.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    RequestError
        If the model cannot be exported, or a file is there that seakeep did not write.
    """
    linear = exportable(model, follows=True)
    live = linear.live(noise=noise, roles=roles)
    return _written(sources(linear, identifier(name), live), folder)


def _written(texts: Mapping[str, str], folder: str | Path) -> list[Path]:
    targets = {make_folder(Path(folder)) / file: text for file, text in texts.items()}
    for target in targets:
        check_output(target, KIND)
    for target, text in targets.items():
        write_text(target, text)
    return list(targets)


def identifier(name: str) -> str:
    """Name for C made of that of a file."""
    text = re.sub(r"\W", "_", name, flags=re.ASCII)
    return text if text[:1].isalpha() else f"m_{text}"


def sources(model: HankelDMDcModel, name: str, live: Live | None = None) -> dict[str, str]:
    """Text of the C files of a model by their names, and of its estimator where it is live."""
    signature, input_map = model.signature, model.signature.input_map
    follows, observed = input_map.follows, input_map.columns
    own, before = (observed.reach(delayed=each)[0] for each in (True, False))
    back = max(follows.back if follows else 0, own - input_map.lead, before)
    kernels: list[FloatArray] = []
    every = [Text(f"u[{place}]", _number) for place in range(len(signature.inputs))]
    u = np.array([every], object)
    delayed, direct = list(map(str, every)), list[str]()
    for group, columns in zip(observed.groups, (delayed, direct), strict=True):
        for each in group:
            for term in each.terms:
                columns += _columns(term, u, observed.limits, kernels)
    limited = zip(direct, observed.tops, observed.slopes, strict=True)
    direct = [f"rising({text}, {_number(top)}, {_number(by)})" for text, top, by in limited]
    content = {
        "name": name,
        "mark": f"{MARK}: {KIND}, written by seakeep {version()}:",
        "model": model,
        "now": back,
        "delayed": delayed,
        "direct": direct,
        "kernels": kernels,
        "growth": GROWTH,
        "fade": fading(signature),
        "soft": SOFT,
        "readouts": [each for each in signature.readouts if each.acts],
        "lines": [
            (each.load, follows.lines(None, (each.load.place,)))
            for each in signature.readouts
            if follows and each.load
        ],
    }
    files = {f"{name}.{end}": rendered(f"model.{end}", **content) for end in ("h", "c")}
    if live:
        content |= live.equations | {
            "prediction": prediction,
            "validity": validity,
            "pi": math.pi,
            "gravity": GRAVITY,
            "after": AFTER,
            "doubted": DOUBTED,
        }
        for end in ("h", "c"):
            files[f"{name}_estimator.{end}"] = rendered(f"estimator.{end}", **content)
    return files


def rendered(template: str, **content: Any) -> str:
    """Text of a template of this room."""
    environment = templates("hosts")
    environment.filters |= {"hex": _number, "numbers": _numbers, "text": _text}
    return environment.get_template(template).render(**content)


def _number(value: float) -> str:
    """A number as C has it, exactly."""
    return float(value).hex() if np.isfinite(value) else ("-" if value < 0 else "") + "INFINITY"


def _numbers(values: FloatArray) -> str:
    """Initialiser of an array; C99 knows none without elements."""
    flat = [_number(value) for value in np.ravel(values)] or ["0.0"]
    return ",\n".join("    " + ", ".join(flat[at : at + 4]) for at in range(0, len(flat), 4))


def _text(value: str) -> str:
    """Literal of C for any text."""
    escaped = re.sub(rb"[^\w /^.-]", lambda match: b"\\%03o" % ord(match[0]), value.encode())
    return f'"{escaped.decode()}"'


def _columns(
    term: Term, u: npt.NDArray[np.object_], limits: FloatArray, kernels: list[FloatArray]
) -> list[str]:
    """Expressions of C in u, the inputs of the row; a filter is put beside the other ones."""
    if not isinstance(term, SlowSquare):
        return [str(each) for each in term.columns(u, limits)[0]]
    number = next((k for k, each in enumerate(kernels) if each is term.kernel), len(kernels))
    if number == len(kernels):
        kernels.append(term.kernel)
    filtered = f"{term.order}, kernel_{number}, {len(term.kernel) // 2}"
    return [f"slow_square(u + ({shift}) * Q + {term.place}, {filtered})" for shift in term.shifts]
