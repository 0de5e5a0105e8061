"""Functional mock-up units: the C sources of a model behind FMI 2.0 for co-simulation."""

import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from seakeep.errors import RequestError
from seakeep.files import MARK, check_output, replacing, version
from seakeep.hosts.c import identifier, rendered, sources
from seakeep.hosts.program import exportable, timing
from seakeep.models import HankelDMDcModel, Model

KIND = "functional mock-up unit"
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
        standard deviations ``std.NAME[1]`` …
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
    check_output(target, KIND)
    linear, name = exportable(model, ahead is not None), identifier(target.stem)
    files = sources(linear, name, None if ahead is None else linear.live(noise=noise, roles=roles))
    digest = hashlib.sha256("".join(files.values()).encode()).digest()
    content = {
        "name": name,
        "mark": f"{MARK}: {KIND},",
        "guid": f"{{{uuid.UUID(bytes=digest[:16])}}}",
        "dt": model.dt,
        "ahead": ahead,
        **_described(linear, ahead),
    }
    files["fmi2.c"] = rendered("fmi2.c", **content)
    description = rendered("modelDescription.xml", **content)
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
        channels, groups = [*given, *measured, *answered, *coming], []
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
