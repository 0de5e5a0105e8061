"""``seakeep calibrate``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer
import xarray as xr
from rich import box
from rich.table import Table

from seakeep.campaign import load_prepared, read_campaign
from seakeep.cli.console import messages, progress_bar, quietly, results
from seakeep.cli.options import DEFAULT_LEVEL, CampaignFile, Level, Scheduler, Workers, crew
from seakeep.conventions import conversion, instant
from seakeep.errors import RequestError
from seakeep.files import check_place
from seakeep.models import HankelEnsemble, load_model
from seakeep.models.forecasting import counted
from seakeep.study.lengths import instant_of, samples_of
from seakeep.study.workflow import between

__all__ = ["calibrate"]


def calibrate(
    ensemble: Annotated[
        Path, typer.Argument(help="Ensemble file written by seakeep fit.", metavar="ENSEMBLE.nc")
    ],
    campaign: CampaignFile,
    steps: Annotated[
        str,
        typer.Option(
            "--steps",
            help="Length of a window, as long as forecasts will be: a number of instants, or "
            "encounter periods such as '15 T'.",
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Ensemble file to write (NetCDF).")],
    run: Annotated[
        list[str] | None,
        typer.Option("--run", help="Name of a run (repeatable); by default those that train."),
    ] = None,
    stop: Annotated[
        str | None,
        typer.Option(
            "--stop",
            help="Last instant used of each run, s or encounter periods such as '40 T'; by default "
            "the end of its training span, or of the run.",
        ),
    ] = None,
    level: Level = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Widen the band of an ensemble so that it holds what it says in the sea it was calibrated in.

    The ensemble forecasts windows end to end, none of which a member has read, and the bounds are
    moved outwards by a quantile of how far measurements lie outside (split-conformal). Leave out
    what the ensemble is to be judged on.

    Example: seakeep calibrate ensemble.nc docs/tutorial/campaign.toml --run unseen --stop 60
    --steps 200 -o calibrated.nc
    """
    check_place(out, ".nc")
    fitted = load_model(ensemble)
    if not isinstance(fitted, HankelEnsemble):
        raise RequestError(
            f"{ensemble} holds a single model, which has no band. Fit an ensemble (kind = "
            "'bayesian_hankel_dmdc' in [model])."
        )
    read = read_campaign(campaign)
    wanted = run or [name for name in read.training_runs if name in fitted.training_spans]
    if not wanted:
        raise RequestError(
            "the campaign has none of the runs that the ensemble was trained on. Name runs of the "
            "same sea with --run."
        )
    with progress_bar("Preparing") as progress:
        prepared = load_prepared(read, names=wanted, progress=progress)
    every = list(prepared.values())
    last = None if stop is None else instant_of(stop, read, every, "--stop")
    if last is not None and not any(last <= float(each["time"][-1]) for each in every):
        end = max(float(each["time"][-1]) for each in every)
        raise RequestError(
            f"--stop {stop} ({last:g} s) lies after the end of {', '.join(prepared)} ({end:g} s). "
            "Name an instant inside, or leave --stop out to use all."
        )
    count = samples_of(steps, read, every, fitted.dt, "--steps")
    parts = {name: _part(each, last) for name, each in prepared.items()}
    with progress_bar("Calibrating") as progress:
        calibrated = fitted.calibrate(
            parts,
            count,
            DEFAULT_LEVEL if level is None else level,
            **crew(workers, scheduler),
            progress=quietly(progress),
        )
    results().print(_table(calibrated))
    assert calibrated.calibration is not None
    used = [
        f"{n} {instant(a)} to {instant(b)} s" for n, (a, b) in calibrated.calibration.spans.items()
    ]
    results().print(f"Calibrated on {', '.join(used)}: judge it on other instants.", soft_wrap=True)
    calibrated.save(out)
    messages().print(
        f"Wrote {out}. Judge it elsewhere with: seakeep compare {out} {campaign} --band calibrated"
    )


def _part(run: xr.Dataset, stop: float | None) -> xr.Dataset:
    """The training span of a run, or all of it, up to an instant."""
    time = run["time"].values
    begin, end = run.attrs.get("train_span", (time[0], time[-1]))
    return between(run, (begin, end if stop is None else min(end, stop)))


def _table(ensemble: HankelEnsemble) -> Table:
    """Margins of the channels, and what they were found on."""
    assert ensemble.calibration is not None
    found, windows = ensemble.calibration.found, ensemble.calibration.windows
    title = (
        f"Margin of the {100 * found.level:g} % band, from "
        f"{counted(sum(windows.values()), 'window')} of {ensemble.calibration.steps} instants "
        f"({', '.join(windows)})"
    )
    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    table.add_column("channel", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for heading in ("margin", "in SD", "blocks", "warranted %"):
        table.add_column(heading, justify="right", no_wrap=True)
    for k, label in enumerate(ensemble.state_labels):
        unit = label.units
        shown = unit.replace("rad", "deg") if unit.split("/")[0] == "rad" else unit
        factor = conversion(unit, shown) if shown != unit else 1.0
        table.add_row(
            label.name,
            shown,
            f"{factor * found.margin[k]:.4g}",
            f"{found.margin[k] / ensemble.state_spread[k]:.3f}",
            f"{found.blocks[k]:.0f}",
            f"{math.floor(1e4 * found.warranted[k] + 1e-6) / 100:g}",
        )
    return table
