"""``seakeep calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

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
from seakeep.errors import RequestError
from seakeep.files import check_output, check_place


def calibrate(
    ensemble: Annotated[
        Path, typer.Argument(help="Ensemble file written by seakeep fit.", metavar="ENSEMBLE.nc")
    ],
    campaign: CampaignFile,
    steps: Annotated[
        str,
        typer.Option(
            help="Length of a window, as long as forecasts will be: a number of instants, or "
            "encounter periods such as '15 T'.",
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Ensemble file to write (NetCDF).")],
    run: Annotated[
        list[str] | None,
        typer.Option(help="Name of a run (repeatable); by default those that train."),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            help="First instant used of each run, s or encounter periods such as '20 T'; by "
            "default the start of its training span, or of the run.",
        ),
    ] = None,
    stop: Annotated[
        str | None,
        typer.Option(
            help="Last instant used of each run, s or encounter periods such as '40 T'; by default "
            "the end of its training span, or of the run.",
        ),
    ] = None,
    level: Level = None,
    scale: Annotated[
        Literal["constant", "spread", "learnt"],
        typer.Option(
            help="Half-width of the band: 'spread', a factor times that of the members with a "
            "floor, 'constant', the members' band moved outwards by the same amount everywhere, or "
            "'learnt' from spread, horizon and waves.",
        ),
    ] = "spread",
    folds: Annotated[
        Literal["run"] | None,
        typer.Option(
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
    from seakeep.report.margins import margins_table
    from seakeep.signals.time_axis import span_text
    from seakeep.study.calibration import calibration_parts
    from seakeep.study.comparison import samples_of

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
    warn_of_runs(prepared.values(), [*fitted.states, *fitted.inputs])
    parts = calibration_parts(read, prepared, fitted.dt, start, stop)
    count = samples_of(steps, read, prepared.values(), fitted.dt, "--steps")
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
    print_table(margins_table(calibrated))
    assert calibrated.calibration is not None
    spans = calibrated.calibration.spans.items()
    used = [f"{name} {span_text(*span, calibrated.dt)}" for name, span in spans]
    show(f"Calibrated on {', '.join(used)}: judge it on other instants.")
    calibrated.save(out)
    whole = sum(calibrated.calibration.windows.values())
    if whole / (whole + 1) < calibrated.calibration.conformal.level:
        say(
            "Note: errors that last for a whole window are seen only once in each. Counted as "
            f"such, {counted(whole, 'window')} would support {100 * whole / (whole + 1):.0f} %; "
            "more windows make the margin surer.",
        )
    say(f"Wrote {out}. Judge it elsewhere with: seakeep compare {out} {campaign} --band calibrated")
