"""C99 sources of a model and of its estimator, without any dependency, alone or as an FMU.

A functional mock-up unit puts the sources behind FMI 2.0 for co-simulation.
"""

import hashlib
import math
import os
import platform
import re
import shlex
import shutil
import subprocess
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from seakeep.arrays import FloatArray
from seakeep.core.readouts import SOFT
from seakeep.errors import RequestError
from seakeep.files import MARK, check_output, make_folder, replacing, templates, version, write_text
from seakeep.hosts.program import exportable, timing
from seakeep.models import HankelDMDcModel, Model, validity
from seakeep.models.engine import GROWTH, fading
from seakeep.models.forecasts import DOUBTED
from seakeep.models.live import AFTER, Live
from seakeep.models.terms import SlowSquare, Term
from seakeep.signals import prediction
from seakeep.signals.expressions import Text
from seakeep.waves import GRAVITY

SOURCE, UNIT = "C source", "functional mock-up unit"
"""Kinds of files, as their marks say it."""


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
    Numbers are written in hexadecimal, so that none is rounded, but in headers, which C++11 reads
    too. ``cc -std=c99 -Wall -Werror`` compiles the code without a warning.
    """
    return _written(_sources(exportable(model), identifier(name)), folder)


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
    return _written(_sources(linear, identifier(name), live), folder)


def _written(texts: Mapping[str, str], folder: str | Path) -> list[Path]:
    targets = {make_folder(Path(folder)) / file: text for file, text in texts.items()}
    for target in targets:
        check_output(target, SOURCE)
    for target, text in targets.items():
        write_text(target, text)
    return list(targets)


def identifier(name: str) -> str:
    """Name for C made of that of a file."""
    text = re.sub(r"\W", "_", name, flags=re.ASCII)
    return text if text[:1].isalpha() else f"m_{text}"


def _sources(model: HankelDMDcModel, name: str, live: Live | None = None) -> dict[str, str]:
    """Text of the C files of a model by their names, and of its estimator where it is live."""
    signature, input_map = model.signature, model.signature.input_map
    follows, observed = input_map.follows, input_map.observed
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
        "mark": f"{MARK}: {SOURCE}, written by seakeep {version()}:",
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
    files = {f"{name}.{end}": _rendered(f"model.{end}", **content) for end in ("h", "c")}
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
            files[f"{name}_estimator.{end}"] = _rendered(f"estimator.{end}", **content)
    return files


def _rendered(template: str, **content: Any) -> str:
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


PLATFORMS = {
    "Linux x86_64": ("linux64", ".so"),
    "Darwin x86_64": ("darwin64", ".dylib"),
    "Darwin arm64": ("darwin64", ".dylib"),
    "Windows AMD64": ("win64", ".dll"),
}
"""Folder of a binary in an FMU and its suffix, by system and processor."""
HERE = f"{platform.system()} {platform.machine()}"


def write_fmu(
    model: Model,
    path: str | Path,
    ahead: int | None = None,
    noise: Mapping[str, float] | None = None,
    roles: Mapping[str, str] | None = None,
) -> Path:
    """Write a model as an FMU 2.0 for co-simulation.

    It holds the sources of :func:`seakeep.hosts.write_c` and, where a C compiler is found, a binary
    for this platform. Parameters ``history.NAME[1]`` … are the measured samples from which it
    starts, oldest first.

    Parameters
    ----------
    model : Model
        As for :func:`seakeep.hosts.write_c`.
    path : str or Path
        File to write; its suffix should be ``.fmu``.
    ahead : int, optional
        Instants that an estimator forecasts. With it the unit follows a vessel, as
        :func:`seakeep.hosts.write_estimator` says: inputs ``measured.NAME`` are the states, NaN
        where they were not measured, and outputs their estimates, ``ahead.NAME[1]`` …, and the
        standard deviations ``std.NAME[1]`` …, and ``model.validity``. Forecasts hold a known input
        at its last value.
    noise, roles : mapping, optional
        Of an estimator, as for ``model.live``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RequestError
        If the model cannot be exported, a file is there that seakeep did not write, or the
        compiler fails.
    """
    target = Path(path)
    if ahead is None and (noise or roles):
        raise RequestError("noise and roles are those of an estimator: give ahead, or neither.")
    check_output(target, UNIT)
    linear, name = exportable(model, ahead is not None), identifier(target.stem)
    files = _sources(linear, name, None if ahead is None else linear.live(noise=noise, roles=roles))
    digest = hashlib.sha256("".join(files.values()).encode()).digest()
    content = {
        "name": name,
        "mark": f"{MARK}: {UNIT},",
        "guid": f"{{{uuid.UUID(bytes=digest[:16])}}}",
        "dt": model.dt,
        "ahead": ahead,
        **_described(linear, ahead),
    }
    files["fmi2.c"] = _rendered("fmi2.c", **content)
    description = _rendered("modelDescription.xml", **content)
    with (
        tempfile.TemporaryDirectory() as folder,
        replacing(target) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        archive.writestr("modelDescription.xml", description, zipfile.ZIP_STORED)
        for file, text in files.items():
            Path(folder, file).write_text(text, encoding="utf-8")
            archive.writestr(f"sources/{file}", text)
        if cc := compiler():
            place, suffix = PLATFORMS[HERE]
            library = _compiled(cc, Path(folder), name, suffix)
            archive.write(library, f"binaries/{place}/{library.name}")
    return target


def compiler() -> list[str] | None:
    """Command of a C compiler that makes a binary for this platform, or None.

    The environment variable ``CC`` names another one than cc, gcc or clang.
    """
    if HERE not in PLATFORMS:
        return None
    if named := shlex.split(os.environ.get("CC", "")):
        return named
    path = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    return [path] if path else None


def _compiled(compiler: list[str], folder: Path, name: str, suffix: str) -> Path:
    library = folder / f"{name}{suffix}"
    flags = ["-std=c99", "-O2", "-shared", "-fPIC", "-fvisibility=hidden"]
    written = sorted(each.name for each in folder.glob("*.c"))
    command = [*compiler, *flags, "-o", library.name, *written, "-lm"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        said, failed = done.stderr, done.returncode
    except OSError as error:
        said, failed = str(error), 1
    if failed:
        raise RequestError(
            f"the C compiler failed: {shlex.join(command)}\n{said.strip()[:500]}\nMend it, name "
            "another one in the environment variable CC, or write the sources alone (--c)."
        )
    return library


def _described(model: HankelDMDcModel, ahead: int | None) -> dict[str, Any]:
    """What the model description says beside names and numbers."""
    signature = model.signature
    inputs, states = signature.input_labels, signature.state_labels
    history = signature.input_history + signature.lead_samples
    # Before any are known, inputs and outputs are their means in training.
    means = (signature.input_scale.centre[: len(inputs)], signature.state_scale.centre)
    groups = [
        [
            {
                "name": _part(label.name),
                "unit": label.units,
                "description": label.long_name,
                "start": start,
                "rows": rows,
                "is_output": labels is states,
            }
            for label, start in zip(labels, mean.tolist(), strict=True)
        ]
        for labels, mean, rows in zip(
            (inputs, states), means, (history, signature.state_samples), strict=True
        )
    ]
    given, answered = groups
    channels = [*given, *answered]
    if ahead is not None:
        measured = [
            each | {"name": f"measured.{each['name']}", "is_output": False} for each in answered
        ]
        coming = [
            each | {"name": f"{kind}.{each['name']}[{step}]", "start": start}
            for kind, starts in (("ahead", means[1]), ("std", signature.state_scale.spread))
            for step in range(1, ahead + 1)
            for each, start in zip(answered, starts.tolist(), strict=True)
        ]
        flags = ", ".join(f"{each.name} {each.value}" for each in validity.Validity)
        outside = answered[0] | {
            "name": "model.validity",
            "unit": "",
            "description": f"sum of {flags}",
            "start": 0.0,
        }
        channels, groups = [*given, *measured, *answered, *coming, outside], []
    return {
        "version": version(),
        "timing": timing(model, ahead is not None),
        # Structured names are ASCII.
        "convention": "structured" if all(c["name"].isascii() for c in channels) else "flat",
        "channels": channels,
        # Histories stand in the order of C: those of the states, row by row, then the inputs'.
        "histories": [
            (channel, row + 1)
            for group in groups[::-1]
            for row in range(group[0]["rows"] if group else 0)
            for channel in group
        ],
        "units": sorted({label.units for label in inputs + states if label.units}),
    }


def _part(name: str) -> str:
    """Part of a structured name of FMI; what is not an identifier stands between quotes."""
    if name.isascii() and name.isidentifier():
        return name
    escaped = name.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"
