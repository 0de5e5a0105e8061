"""``seakeep export``.

``seakeep info``.
"""

from __future__ import annotations

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option, echo

from seakeep.cli.console import ModelFile, say
from seakeep.errors import RequestError
from seakeep.files import check_place

if TYPE_CHECKING:
    from seakeep.models import Model


def export(
    model: ModelFile,
    c: Annotated[
        Path | None,
        Option(help="Folder for C99 sources: a library of two files.", metavar="DIR"),
    ] = None,
    estimator: Annotated[
        bool,
        Option("--estimator", help="Of C99 sources and FMU: an estimator beside a vessel."),
    ] = False,
    fmu: Annotated[
        Path | None,
        Option(help="FMU 2.0 for co-simulation to write.", metavar="FILE.fmu"),
    ] = None,
    onnx: Annotated[
        Path | None,
        Option(help="ONNX graph to write.", metavar="FILE.onnx"),
    ] = None,
    mat: Annotated[
        Path | None,
        Option(help="State-space system for MATLAB.", metavar="FILE.mat"),
    ] = None,
    order: Annotated[
        int | None,
        Option(help="Order of the MATLAB system, by balanced truncation.", min=1),
    ] = None,
    steps: Annotated[
        int | None,
        Option(
            help="Instants that an ONNX graph, or an estimator's FMU, forecasts; by default 1.",
            min=1,
        ),
    ] = None,
    member: Annotated[
        int | None,
        Option(help="For an ensemble: the member to export, from 0.", min=0),
    ] = None,
) -> None:
    """Write a model for another host: C, FMU, ONNX, MATLAB.

    The exported model computes the same as forecast_arrays; the command says which inputs a step
    takes. The FMU holds its C sources, and a binary for this platform if a C compiler is found.

    Example: seakeep export model.nc --c library --fmu model.fmu
    """
    if not any((c, fmu, onnx, mat)):
        raise RequestError("nothing to write. Give --c DIR, --fmu, --onnx or --mat FILE.")
    follows = fmu if estimator else None
    _check_beside(
        (steps, onnx or follows, "--steps belongs to --onnx FILE, or --fmu --estimator"),
        (order, mat, "--order belongs to --mat FILE"),
        (estimator, c or fmu, "--estimator belongs to --c DIR or --fmu FILE"),
    )
    if estimator and order is not None:
        raise RequestError(
            "--order reduces the linear system of --mat; an estimator corrects measured states and "
            "their delays, which a reduced system no longer holds. Leave out --order, or "
            "--estimator."
        )
    for path, suffix in ((fmu, ".fmu"), (onnx, ".onnx"), (mat, ".mat")):
        if path is not None:
            check_place(path, suffix)
    from seakeep.hosts import write_c, write_estimator, write_fmu, write_onnx
    from seakeep.hosts.program import exportable, timing

    linear = exportable(_single(model, member), estimator)
    written: list[Path] = []
    bound = ""
    if c is not None:
        written += (write_estimator if estimator else write_c)(linear, c, model.stem)
    if fmu is not None:
        written.append(write_fmu(linear, fmu, (steps or 1) if estimator else None))
    if onnx is not None:
        written.append(write_onnx(linear, onnx, steps or 1))
    if mat is not None:
        written.append(linear.to_mat(mat, order))
        bound = _bound(mat) if order else ""
    say(f"Wrote {', '.join(map(str, written))}.{bound}")
    if fmu is not None:
        say(_binary(fmu))
    say(timing(linear, estimator and not onnx and not mat))


def _check_beside(*rules: tuple[object, Path | None, str]) -> None:
    """Refuse an option that is given without the target that it belongs to."""
    for given, target, words in rules:
        if given and target is None:
            raise RequestError(f"{words}. Leave it out, or give both.")


def _single(file: Path, member: int | None) -> Model:
    """The model of a file, or a member of the ensemble that it holds."""
    from seakeep.models import is_ensemble, load_model

    loaded = load_model(file)
    if member is None:
        return loaded
    if not is_ensemble(loaded):
        raise RequestError(
            f"--member is for ensembles, and {file} holds a single model. Leave it out."
        )
    return loaded.member(member)


def _binary(fmu: Path) -> str:
    from seakeep.hosts.fmu import compiler

    if compiler() is not None:
        return f"{fmu} holds a binary for this platform, and the sources for others."
    return (
        f"{fmu} holds sources alone: no C compiler was found (cc, gcc, clang, or CC). Export it "
        "where there is one, or with a host that compiles the sources."
    )


def _bound(mat: Path) -> str:
    """How far the reduced system of a file errs, as a sentence after another one."""
    from scipy.io import loadmat

    content = loadmat(mat, variable_names=["ErrorBound", "A"])
    return (
        f" The system of order {len(content['A'])} errs by {content['ErrorBound'].item():.3g} SD "
        "of its outputs per SD of its inputs, at most, at any frequency."
    )


_PACKAGES = ("numpy", "scipy", "xarray", "h5netcdf", "h5py", "pandas", "pydantic", "typer", "pint")
_EXTRAS = ("matplotlib", "control", "numba")


def info() -> None:
    """Print versions and environment, for a bug report.

    Example: seakeep info
    """
    echo(f"seakeep {metadata.version('seakeep')}")
    echo(f"Python {platform.python_version()} on {platform.platform()}")
    echo(f"cores {os.cpu_count()}")
    for name in (*_PACKAGES, *_EXTRAS):
        try:
            echo(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            echo(f"{name} not installed")
    for name in ("SEAKEEP_DATA_DIR", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        echo(f"{name}={os.environ.get(name, '')}")
