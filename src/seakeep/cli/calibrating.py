"""``seakeep calibrate``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from seakeep.cli.console import print_table, progress_bar, say, show
from seakeep.cli.options import (
    DEFAULT_LEVEL,
    CampaignFile,
    Level,
    Scheduler,
    Workers,
    member_executor,
    read_files,
)
from seakeep.conventions import displayed
from seakeep.errors import RequestError
from seakeep.files import check_output, check_place

if TYPE_CHECKING:
    import xarray as xr

    from seakeep.campaign import Campaign
    from seakeep.models import HankelEnsemble
    from seakeep.report.tables import Table


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
    start: Annotated[
        str | None,
        typer.Option(
            "--start",
            help="First instant used of each run, s or encounter periods such as '20 T'; by "
            "default the start of its training span, or of the run.",
        ),
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
    scale: Annotated[
        Literal["constant", "spread", "learnt"],
        typer.Option(
            "--scale",
            help="Half-width of the band: 'spread', a factor times that of the members with a "
            "floor, 'constant', the members' band moved outwards by the same amount everywhere, or "
            "'learnt' from spread, horizon and waves.",
        ),
    ] = "spread",
    folds: Annotated[
        Literal["run"] | None,
        typer.Option(
            "--folds",
            help="'run': members trained on the other runs forecast each training run; by default "
            "only windows that no member has read count.",
        ),
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Calibrate the band of an ensemble on measured windows.

    The calibrated band holds the stated share of the measurement, in the sea of these runs.
    The ensemble forecasts windows, end to end, that no member has read; a quantile of its errors
    there gives the band (split-conformal prediction). Judge the band on other windows.

    Example: seakeep calibrate ensemble.nc docs/tutorial/campaign.toml --run unseen --stop 60
    --steps 200 -o calibrated.nc
    """
    check_place(out, ".nc")
    from seakeep.campaign import load_prepared, read_campaign
    from seakeep.models import is_ensemble, load_model
    from seakeep.models.forecasts import counted
    from seakeep.quality import warn_of_runs
    from seakeep.signals.time_axis import instant_text, span_text
    from seakeep.study.comparison import samples_of
    from seakeep.study.plan import between

    fitted = load_model(ensemble)
    if not is_ensemble(fitted):
        raise RequestError(
            f"{ensemble} holds a single model, which has no band. Fit an ensemble (kind = "
            "'bayesian_hankel_dmdc' in [model])."
        )
    read = read_campaign(campaign)
    check_output(out, "model", read_files(read, ensemble))
    wanted = run or [name for name in read.training_runs if name in fitted.training_spans]
    if not wanted:
        raise RequestError(
            "the campaign has none of the runs that the ensemble was trained on. Name runs of the "
            "same sea with --run."
        )
    with progress_bar("Preparing") as progress:
        prepared = load_prepared(read, names=wanted, progress=progress)
    every = list(prepared.values())
    warn_of_runs(every, [*fitted.states, *fitted.inputs])
    first = _instant(start, "--start", read, prepared, fitted.dt)
    last = _instant(stop, "--stop", read, prepared, fitted.dt)
    if first is not None and last is not None and first >= last:
        begin, end = (instant_text(edge, fitted.dt) for edge in (first, last))
        raise RequestError(f"--start {start} ({begin} s) lies at or after --stop {stop} ({end} s).")
    count = samples_of(steps, read, every, fitted.dt, "--steps")
    parts = {}
    for name, each in prepared.items():
        begin, end = each.attrs.get("train_span", each["time"].values[[0, -1]])
        stop_at = end if last is None else last
        parts[name] = between(each, (begin if first is None else first, stop_at))
    with member_executor(workers, scheduler) as executor, progress_bar("Calibrating") as progress:
        calibrated = fitted.calibrate(
            parts,
            count,
            DEFAULT_LEVEL if level is None else level,
            scale=scale,
            folds=folds,
            executor=executor,
            progress=progress,
        )
    print_table(_table(calibrated))
    assert calibrated.calibration is not None
    spans = calibrated.calibration.spans.items()
    used = [f"{name} {span_text(*span, calibrated.dt)}" for name, span in spans]
    show(f"Calibrated on {', '.join(used)}: judge it on other instants.")
    calibrated.save(out)
    whole = sum(calibrated.calibration.windows.values())
    if whole / (whole + 1) < calibrated.calibration.found.level:
        say(
            "Note: errors that last for a whole window are seen only once in each. Counted as "
            f"such, {counted(whole, 'window')} would support {100 * whole / (whole + 1):.0f} %; "
            "more windows make the margin surer.",
        )
    say(f"Wrote {out}. Judge it elsewhere with: seakeep compare {out} {campaign} --band calibrated")


def _instant(
    stated: str | None, name: str, campaign: Campaign, runs: Mapping[str, xr.Dataset], dt: float
) -> float | None:
    """An instant that lies inside one of the runs at least; a stop of 'inf' is the end of all."""
    if stated is None:
        return None
    from seakeep.signals.time_axis import instant_text, span_text
    from seakeep.study.comparison import instant_of

    found = instant_of(stated, campaign, runs.values(), name)
    if name == "--stop" and found == math.inf:
        return found
    spans = {key: (float(each["time"][0]), float(each["time"][-1])) for key, each in runs.items()}
    if not any(begin <= found <= end for begin, end in spans.values()):
        known = ", ".join(
            f"{key}: {span_text(begin, end, dt)}" for key, (begin, end) in spans.items()
        )
        raise RequestError(
            f"{name} {stated} ({instant_text(found, dt)} s) lies in none of the runs ({known}). "
            f"Name an instant inside, or leave {name} out."
        )
    return found


def _table(ensemble: HankelEnsemble) -> Table:
    """Margins of the channels, or factors and floors of their scale, and what they rest on."""
    from seakeep.models.forecasts import counted
    from seakeep.report.tables import Table

    calibration = ensemble.calibration
    assert calibration is not None
    found, windows, floor = calibration.found, calibration.windows, calibration.floor
    made = {
        "constant": "Margin",
        "spread": "Factor k and floor f, ±k·√(σ² + f²),",
        "learnt": "Factor k of a learnt scale and its floor f",
    }[calibration.scale]
    width = found.margin if floor is None else floor
    title = (
        f"{made} of the {100 * found.level:g} % band, from "
        f"{counted(sum(windows.values()), 'window')} of {calibration.steps} instants "
        f"({', '.join(windows)})"
    )
    rows = []
    for k, label in enumerate(ensemble.state_labels):
        factor, shown = displayed(label.units)
        rows.append(
            (
                label.name,
                shown,
                *([] if floor is None else [f"{found.margin[k]:.2f}"]),
                f"{factor * width[k]:.4g}",
                f"{width[k] / ensemble.state_spread[k]:.3f}",
                f"{found.blocks[k]:.0f}",
                f"{math.floor(1e4 * found.warranted[k] + 1e-6) / 100:g}",
            )
        )
    names = ("margin",) if floor is None else ("k", "f")
    columns = ("channel", "unit", *names, "in SD", "blocks", "warranted %")
    return Table("margins", title, columns, tuple(rows), numeric=tuple(range(2, len(columns))))
