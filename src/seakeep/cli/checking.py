"""``seakeep check``.

``seakeep calibrate``.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from typer import Argument, Option

from seakeep.cli.console import (
    DEFAULT_LEVEL,
    CampaignFile,
    Level,
    ModelFile,
    Scheduler,
    Workers,
    member_executor,
    print_table,
    progress_bar,
    read_files,
    say,
    show,
)
from seakeep.errors import RequestError, SeakeepError
from seakeep.files import check_output, check_place, check_report, make_folder


def check(
    model: ModelFile,
    campaign: CampaignFile,
    run: Annotated[
        list[str] | None,
        Option(help="Name of a run (repeatable); by default all that a check can use."),
    ] = None,
    out: Annotated[
        Path, Option("-o", "--out", help="Folder for the page, its figures and tables.")
    ] = Path("check"),
) -> None:
    """Compare a model with the measured vessel, on one page.

    The page starts with the error over the tests beside that of baselines, and a verdict on each
    channel. It shows the model's response to waves beside the measured one, with uncertainties, its
    error beside the least error that its inputs allow, and its modes, residuals and statistics.
    It names the checks that these runs do not allow, with the reason.

    Example: seakeep check model.nc docs/tutorial/campaign.toml -o check
    """
    from seakeep.campaign import load_prepared, read_campaign
    from seakeep.check import check_model
    from seakeep.models import load_model
    from seakeep.models.forecasts import counted
    from seakeep.report.check_page import check_sections, write_check
    from seakeep.study import fit_baselines
    from seakeep.study.fit import repeats_of

    make_folder(out)
    identified = load_model(model)
    read = read_campaign(campaign)
    check_output(out / "report.html", "report", read_files(read, model))
    check_report(out)
    channels = identified.states, identified.inputs
    with progress_bar("Preparing") as progress:
        used = [*channels[0], *channels[1]]
        runs = load_prepared(read, names=run or None, progress=progress, channels=used)
    try:
        prepared = None if run else runs
        baselines = fit_baselines(read, *channels, prepared=prepared, beside=identified)
    except SeakeepError as error:
        say(f"Note: no baselines to compare with: {error}")
        baselines = {}
    with progress_bar("Checking") as progress:
        checked = check_model(identified, runs, progress, baselines)
    repeats = repeats_of(identified, read, runs)
    checked = replace(checked, repeats={name: str(each) for name, each in repeats.items()})
    for section in check_sections(checked):
        for text in (*section.points, *section.notices):
            show(f"{section.title}: {text}")
    kind = ", ".join(
        counted(len(names), what)
        for names, what in ((identified.states, "state"), (identified.inputs, "input"))
    )
    words = f"{model.name}, a model of kind {identified.kind} ({kind}), on {read.name}."
    page = write_check(checked, out, f"{model.stem}: what the model is worth", words)
    say(f"Wrote {page}.")


def calibrate(
    ensemble: Annotated[
        Path, Argument(help="Ensemble file written by seakeep fit.", metavar="ENSEMBLE.nc")
    ],
    campaign: CampaignFile,
    steps: Annotated[
        str,
        Option(
            help="Length of a window, as long as forecasts will be: a number of instants, or "
            "encounter periods such as '15 T'.",
        ),
    ],
    out: Annotated[Path, Option("-o", "--out", help="Ensemble file to write (NetCDF).")],
    run: Annotated[
        list[str] | None,
        Option(help="Name of a run (repeatable); by default those that train."),
    ] = None,
    start: Annotated[
        str | None,
        Option(
            help="First instant used of each run, s or encounter periods such as '20 T'; by "
            "default the start of its training span, or of the run.",
        ),
    ] = None,
    stop: Annotated[
        str | None,
        Option(
            help="Last instant used of each run, s or encounter periods such as '40 T'; by default "
            "the end of its training span, or of the run.",
        ),
    ] = None,
    level: Level = None,
    scale: Annotated[
        Literal["constant", "spread", "learnt"],
        Option(
            help="Half-width of the band: 'spread', a factor times that of the members with a "
            "floor, 'constant', the members' band moved outwards by the same amount everywhere, or "
            "'learnt' from spread, horizon and waves.",
        ),
    ] = "spread",
    folds: Annotated[
        Literal["run"] | None,
        Option(
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
    from seakeep.report.comparison import margins_table
    from seakeep.signals.time_axis import span_text
    from seakeep.study.comparison import calibration_parts, samples_of

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
        used = [*fitted.states, *fitted.inputs]
        prepared = load_prepared(read, names=wanted, progress=progress, channels=used)
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
