"""``seakeep info``."""

from __future__ import annotations

import os
import platform
from importlib import metadata

import typer

_PACKAGES = ("numpy", "scipy", "xarray", "h5netcdf", "h5py", "pandas", "pydantic", "typer", "pint")
_EXTRAS = ("matplotlib", "control", "numba")


def info() -> None:
    """Print versions and environment, for a bug report.

    Example: seakeep info
    """
    typer.echo(f"seakeep {metadata.version('seakeep')}")
    typer.echo(f"Python {platform.python_version()} on {platform.platform()}")
    typer.echo(f"cores {os.cpu_count()}")
    for name in _PACKAGES:
        typer.echo(f"{name} {metadata.version(name)}")
    for name in _EXTRAS:
        try:
            typer.echo(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            typer.echo(f"{name} not installed")
    for name in ("SEAKEEP_DATA_DIR", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        typer.echo(f"{name}={os.environ.get(name, '')}")
