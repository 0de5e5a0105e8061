"""The command ``seakeep``."""

import io
import os
import platform
import sys
import traceback
from importlib import metadata
from pathlib import Path
from typing import Annotated

import typer

from seakeep.cli import campaigns, judging, modelling
from seakeep.cli.console import say, tell_warnings
from seakeep.errors import SeakeepError

__all__ = ["app", "main"]

# One thread of BLAS: sums are split by the number of threads, and the last digits with them. Set
# before numpy is loaded, which reads them once; commands import what computes when they run.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"):
    os.environ[_name] = "1"

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells count it."""

app = typer.Typer(
    name="seakeep",
    help=(
        "Data-driven models of vessels in waves: from measured runs to judged forecasts.\n\n"
        "Example: seakeep fit docs/tutorial/campaign.toml -o model.nc"
    ),
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"seakeep {metadata.version('seakeep')}")
        raise typer.Exit


@app.callback()
def _options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Read the options before the verb; ``main`` looks for --debug itself."""


_PACKAGES = ("numpy", "scipy", "xarray", "h5netcdf", "h5py", "pandas", "pydantic", "typer", "pint",
             "matplotlib", "control", "numba")  # fmt: skip


def info(
    model: Annotated[
        Path | None, typer.Argument(help="Model file to describe.", metavar="MODEL.nc")
    ] = None,
) -> None:
    """Describe a model file, or print versions for a bug report.

    Of a model: kind, channels, settings, how they were chosen, training, calibrated band and
    stability, as seakeep fit printed them.

    Example: seakeep info

    A model: seakeep info model.nc
    """
    if model:
        from seakeep.models import load_model

        typer.echo(load_model(model).summary())
        return
    typer.echo(f"seakeep {metadata.version('seakeep')}")
    typer.echo(f"Python {platform.python_version()} on {platform.platform()}")
    typer.echo(f"cores {os.cpu_count()}")
    for name in _PACKAGES:
        try:
            typer.echo(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            typer.echo(f"{name} not installed")
    for name in ("SEAKEEP_DATA_DIR", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        typer.echo(f"{name}={os.environ.get(name, '')}")


for _verb in (
    campaigns.tank,
    campaigns.init,
    campaigns.prepare,
    modelling.tune,
    modelling.fit,
    modelling.calibrate,
    judging.forecast,
    judging.compare,
    modelling.export,
    judging.check,
    judging.study,
    judging.report,
    judging.reproduce,
    campaigns.track,
    info,
):
    app.command()(_verb)
app.add_typer(campaigns.datasets, name="datasets")


def _unforeseen(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return (
            f"there is not enough memory ({error}). Ask for fewer samples, channels, members or "
            "workers, or take a machine with more."
        )
    if isinstance(error, OSError):
        place = "" if error.filename is None else f"{error.filename}: "
        return (
            f"{place}{error.strerror or error}. Correct the path, or check its permissions and the "
            "disk."
        )
    place = "".join(f"{note}: " for note in getattr(error, "__notes__", ()))
    return (
        f"{place}{type(error).__name__}: {error}. This is a fault of seakeep, or of a model of "
        "your own. Run the command again with --debug, and report a fault of seakeep with what it "
        "prints and `seakeep info`."
    )


def main(arguments: list[str] | None = None) -> int:
    """Run a command; the entry point of ``seakeep``.

    Parameters
    ----------
    arguments : list of str, optional
        Arguments after ``seakeep``; by default those of the program.

    Returns
    -------
    int
        0 done, 1 the run failed, 2 the request is wrong, 130 interrupted.
    """
    received = sys.argv[1:] if arguments is None else arguments
    debug = "--debug" in received
    received = [each for each in received if each != "--debug"]
    command = typer.main.get_command(app)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a console without Greek letters shows "?"
            stream.reconfigure(errors="replace")
    try:
        with tell_warnings():
            command.main(args=received, prog_name="seakeep")
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        if status == INTERRUPTED:
            say(
                "Interrupted. Finished files are kept. Run the same command again: a study goes on "
                "where it stopped, and so does tune; others start anew.",
                style="red",
            )
        return status
    except SeakeepError as error:
        if debug:
            traceback.print_exc()
        say(f"Error: {error}", style="red")
        return error.exit_status
    except BrokenPipeError:
        return 1
    except Exception as error:
        if debug:
            traceback.print_exc()
        say(f"Error: {_unforeseen(error)}", style="red")
        return 1
    return 0
