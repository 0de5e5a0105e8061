"""``seakeep forecast``, ``compare``, ``check``, ``study``, ``reproduce`` and ``report``."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer import Argument, Exit, Option

from seakeep.cli.console import (
    DEFAULT_LEVEL,
    BandKind,
    CampaignFile,
    Degrees,
    FullScale,
    Level,
    ModelFile,
    Scheduler,
    Steps,
    Workers,
    cores,
    executor_of,
    print_table,
    progress_bar,
    read_files,
    refuse,
    say,
    say_written,
    show,
)
from seakeep.errors import RequestError, SeakeepError
from seakeep.files import check_output, check_report, make_folder

if TYPE_CHECKING:
    import xarray as xr

    from seakeep.arrays import Datasets
    from seakeep.campaign import Campaign
    from seakeep.models import Model
    from seakeep.study import Comparison, StudyResult


Preset = Literal["paper", "recommended"]

AllCores = Annotated[
    int | None,
    Option(
        help="Processes on this machine, each on one core; by default one per core.",
        min=1,
        metavar="N",
    ),
]

TABLE = "comparison.csv"
DIFFERENCES = "differences.csv"
ERRORS, NOWCAST = "errors_by_run", "nowcast_"
FOR_ENSEMBLES = (
    "is for ensembles, and {} holds a single model. Leave it out, or fit an ensemble (kind = "
    "'bayesian_hankel_dmdc' in [model])."
)
NO_BAND = "belongs to the band, and --members writes the members without it. Leave one of them out."
NO_NOWCAST = (
    "and --nowcast do not go together: forecasts start all over the runs, one after the other, "
    "with the band of the filter, and their errors are in training SDs. Leave one of them out."
)


def forecast(
    model: ModelFile,
    campaign: CampaignFile,
    run: Annotated[str, Option(help="Name of the run.")],
    start: Annotated[
        str,
        Option(
            help="Instant of the last measured state, s or encounter periods such as '20 T'; "
            "'+300' is 300 s after the start of the run."
        ),
    ],
    out: Annotated[Path, Option("-o", "--out", help="Result: .nc or .csv.")],
    steps: Steps = None,
    level: Level = None,
    band: BandKind = None,
    members: Annotated[
        bool, Option("--members", help="For an ensemble: write each member, and no statistics.")
    ] = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    full_scale: FullScale = False,
    degrees: Degrees = False,
    ahead: Annotated[
        Literal["refuse", "predict"],
        Option(
            help="If the waves end before the model's look-ahead: 'refuse', or 'predict' them "
            "from their record."
        ),
    ] = "refuse",
) -> None:
    """Forecast a run from START, driven by measured waves.

    The model runs freely after START and reads no measured state there.
    For an ensemble, the result is mean, standard deviation and band of its members.

    Example: seakeep forecast model.nc docs/tutorial/campaign.toml --run unseen --start 20
    --steps 400 -o forecast.csv

    In encounter periods: seakeep forecast model.nc docs/tutorial/campaign.toml --run unseen
    --start '20 T' --steps '15 T' -o periods.csv

    An ensemble: seakeep forecast ensemble.nc docs/tutorial/campaign.toml --run unseen --start 20
    --steps 400 --level 0.9 -o band.csv
    """
    if out.suffix not in (".nc", ".csv"):
        raise RequestError(f"{out} ends in '{out.suffix}'; a forecast is written as .nc or .csv.")
    from seakeep.campaign import load_prepared, read_campaign
    from seakeep.models import is_ensemble, load_model
    from seakeep.report.comparison import (
        forecast_header,
        forecast_words,
        look_ahead_words,
        write_forecast,
    )
    from seakeep.signals.time_axis import instant_text
    from seakeep.study import to_full_scale, with_degrees
    from seakeep.study.comparison import instant_of, samples_of
    from seakeep.study.fit import warn_of_waves

    identified = load_model(model)
    read = read_campaign(campaign)
    scale = _scale(read) if full_scale else None
    check_output(out, "forecast", read_files(read, model), forecast_header(identified.states))
    band_options = _band({str(model): identified}, level, band, scheduler, members)
    channels = [*identified.states, *identified.inputs]
    prepared = load_prepared(read, names=[run], channels=channels)[run]
    first = instant_of(start, read, prepared, "--start")
    if not isfinite(first):
        raise RequestError(f"--start: received {start[:20]!r}. Give an instant within the run, s.")
    count = None if steps is None else samples_of(steps, read, prepared, identified.dt, "--steps")
    left = round((float(prepared["time"][-1]) - first) / identified.dt)
    warn_of_waves(identified, prepared, run, first, left if count is None else count)
    if is_ensemble(identified):
        with (
            executor_of(workers, scheduler) as executor,
            progress_bar("Forecasting") as progress,
        ):
            how: Any = {"ahead": ahead, "executor": executor, "progress": progress}
            if members:
                result = identified.forecast(prepared, first, count, **how)
            else:
                result = identified.forecast_summary(prepared, first, count, **how, **band_options)
    else:
        result = identified.forecast(prepared, first, count, ahead=ahead)
    if scale:
        result = to_full_scale(result, scale)
    if degrees:
        result = with_degrees(result)
    write_forecast(result, out)
    status = result.attrs["status"]
    begin = instant_text(result.attrs["start"], identified.dt)
    reads = look_ahead_words(result.attrs.get("reads_input_until", 0.0))
    say(
        f"Wrote {out}: {forecast_words(result)}{result.sizes['time']} instants after "
        f"t = {begin} s, status {status}{reads and f'; {reads}'}."
    )
    all_lost = result.attrs.get("diverged", 0) == result.sizes.get("member")
    if all_lost or "diverged_at" in result.attrs:
        raise Exit(1)


def compare(
    model: Annotated[
        list[Path], Argument(help="Model files written by seakeep fit.", metavar="MODEL.nc...")
    ],
    campaign: CampaignFile,
    run: Annotated[
        list[str] | None, Option(help="Name of a run (repeatable); by default the test runs.")
    ] = None,
    start: Annotated[
        str | None,
        Option(
            help="Instant of the last measured state, s or encounter periods such as '20 T'; "
            "'+300' is 300 s after the start of each run; by default the first possible one in "
            "waves."
        ),
    ] = None,
    steps: Steps = None,
    out: Annotated[
        Path, Option("-o", "--out", help="Folder for the table and the figures.")
    ] = Path("comparison"),
    format_: Annotated[
        Literal["png", "svg", "pdf"], Option("--format", help="Format of the figures.")
    ] = "png",
    degrees: Degrees = True,
    level: Level = None,
    band: BandKind = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    full_scale: FullScale = False,
    baselines: Annotated[
        bool,
        Option(
            "--baselines",
            help="Fit every baseline to the training runs and compare with them.",
        ),
    ] = False,
    nowcast: Annotated[
        bool,
        Option(
            "--nowcast",
            help="Follow the runs sample by sample, without future waves, and judge the error "
            "against lead time (--steps: the longest).",
        ),
    ] = False,
) -> None:
    """Judge forecasts of test runs against the measurement.

    Prints tables per run and writes them as CSV, with an overlay figure per run. Of an ensemble,
    the mean and the coverage of the band are judged. Several models are judged over the same
    instants, with the change of the error from the first one, its interval, and a figure of the
    errors by wave period.

    Example: seakeep compare model.nc docs/tutorial/campaign.toml -o comparison

    Two models: seakeep compare model.nc ensemble.nc docs/tutorial/campaign.toml --baselines

    In service: seakeep compare model.nc docs/tutorial/campaign.toml --nowcast --steps '2 T' -o now
    """
    from seakeep.campaign import read_campaign
    from seakeep.models import load_model
    from seakeep.report.comparison import (
        difference_blocks,
        winner,
        write_comparison,
        write_differences,
    )
    from seakeep.study import compare_models, comparison_table, difference_table
    from seakeep.study.comparison import read_tests, served

    make_folder(out)
    # Names of model files: their stems, or their paths where two would be the same.
    stems = [path.stem for path in model]
    names = {p.stem if stems.count(p.stem) == 1 else str(p.with_suffix("")): p for p in model}
    fitted = {name: load_model(path) for name, path in names.items()}
    shown = _band(fitted, level, band, scheduler)
    read = read_campaign(campaign)
    runs = run or read.test_runs
    names_of_figures = [f"{NOWCAST}{each}" for each in runs] if nowcast else [*runs, ERRORS]
    figures = _figures(names_of_figures, out, format_)
    used = read_files(read, *model)
    check_output(out / TABLE, "table", used, "run,channel,channel_units,.*")
    check_output(out / DIFFERENCES, "table", used, "run,wave_period,model,.*")
    for path in figures.values():
        check_output(path, "figure", used)
    if nowcast:
        given = {"--start": start, "--band": band, "--workers": workers, "--scheduler": scheduler}
        refuse(given | {"--full-scale": full_scale, "--radians": not degrees}, NO_NOWCAST)
    if baselines:
        if not nowcast:
            with progress_bar("Comparing") as progress:  # what is refused is so before the fits
                read_tests(fitted, read, runs, start, steps, progress)
        fitted = _with_baselines(fitted, read)
    if nowcast:
        serving = {n: each for n, each in fitted.items() if n in names or served(each)}
        _nowcast(serving, read, runs, steps, shown["level"], out, figures, used)
        return
    scale = _scale(read) if full_scale else None
    with executor_of(workers, scheduler) as executor, progress_bar("Comparing") as progress:
        comparisons = compare_models(
            fitted,
            read,
            runs,
            start,
            steps,
            progress,
            members=progress,
            **shown,
            executor=executor,
        )
    comparisons = {
        n: [_displayed(each, scale, degrees) for each in of] for n, of in comparisons.items()
    }
    tables = {name: comparison_table(of) for name, of in comparisons.items()}
    _print_comparison(tables)
    written = [write_comparison(tables, out / TABLE)]
    differences = None
    if len(comparisons) > 1:
        differences = difference_table(comparisons)
        for block in difference_blocks(differences):
            print_table(block)
        show(winner(differences, {n: each.kind for n, each in fitted.items() if n not in names}))
        written.append(write_differences(differences, out / DIFFERENCES))
    written += _draw({name: comparisons[name] for name in names}, figures, differences)
    say_written(written)
    if not all(each.complete for name in names for each in comparisons[name]):
        raise Exit(1)


def _displayed(each: Comparison, scale: float | None, degrees: bool) -> Comparison:
    """A comparison at full scale, where there is a scale, and in degrees, if wanted."""
    from seakeep.study import at_full_scale, in_degrees

    each = at_full_scale(each, scale) if scale else each
    return in_degrees(each) if degrees else each


def _nowcast(
    models: Mapping[str, Model],
    campaign: Campaign,
    runs: list[str],
    steps: str | None,
    level: float,
    out: Path,
    figures: Mapping[str, Path],
    used: list[Path],
) -> None:
    """Judge models in service: tables on the terminal, a CSV file, a figure per run."""
    from seakeep.report.comparison import HEADER, nowcast_blocks, write_nowcasts
    from seakeep.report.figures.errors import nowcast_figure
    from seakeep.report.style import save_figure
    from seakeep.study import nowcasts

    table = out / "nowcast.csv"
    check_output(table, "table", used, HEADER)
    with progress_bar("Playing") as progress:
        results = nowcasts(models, campaign, runs, steps, level=level, progress=progress)
    for block in nowcast_blocks(results):
        print_table(block)
    written = [write_nowcasts(results, table)]
    written += [
        save_figure(nowcast_figure(results, name.removeprefix(NOWCAST)), path)
        for name, path in figures.items()
    ]
    say_written(written)


def _figures(names: list[str], out: Path, suffix: str) -> dict[str, Path]:
    """Files of figures by name, where figures can be drawn."""
    if not find_spec("matplotlib"):
        say(
            "Note: no figures, because matplotlib is not installed. "
            "Install it with: pip install 'seakeep[figures]'"
        )
        return {}
    return {name: out / f"{name}.{suffix}" for name in names}


def _with_baselines(fitted: Mapping[str, Model], campaign: Campaign) -> dict[str, Model]:
    """Models and baselines of the same channels, by name."""
    from seakeep.study import fit_baselines
    from seakeep.study.comparison import check_alike

    check_alike(fitted)
    first = next(iter(fitted.values()))
    channels = max((each.inputs for each in fitted.values()), key=len)
    with progress_bar("Baselines") as progress:
        baselines = fit_baselines(campaign, first.states, channels, progress, beside=first)
    names = {kind: kind if kind not in fitted else f"{kind} (baseline)" for kind in baselines}
    return {**fitted, **{names[kind]: each for kind, each in baselines.items()}}


def _print_comparison(tables: Datasets) -> None:
    from seakeep.report.comparison import band_findings, comparison_blocks, model_blocks

    several = len(tables) > 1
    for block in model_blocks(tables) if several else comparison_blocks(*tables.values()):
        print_table(block)
    for name, table in tables.items():
        for text in band_findings(table):
            show(f"{name}, {text}" if several else text)


def _draw(
    comparisons: Mapping[str, list[Comparison]],
    figures: Mapping[str, Path],
    differences: xr.Dataset | None,
) -> list[Path]:
    if not figures:
        return []
    from seakeep.report.figures.errors import error_figure
    from seakeep.report.figures.histories import overlay_figure
    from seakeep.report.style import save_figure

    written = []
    for of_run in zip(*comparisons.values(), strict=True):
        figure = overlay_figure(dict(zip(comparisons, of_run, strict=True)))
        written.append(save_figure(figure, figures[of_run[0].run]))
    if differences:
        written.append(save_figure(error_figure(differences), figures[ERRORS]))
    return written


def _scale(campaign: Campaign) -> float:
    """Scale factor of a campaign; says what is at which scale."""
    general = campaign.settings.campaign
    if "scale_factor" not in general.model_fields_set:
        raise RequestError(
            f"--full-scale needs the scale factor, and {campaign.path} states none. Add "
            "scale_factor (full-scale length over model length) to [campaign]."
        )
    scale = general.scale_factor
    say(f"Results are at full scale (1:{scale:g}); notes, --start and --steps are at model scale.")
    return scale


def _band(
    models: Mapping[str, Model],
    level: float | None,
    band: str | None,
    scheduler: str | None,
    members: bool = False,
) -> dict[str, Any]:
    """Level and kind of band that were asked for; a calibrated one knows its level."""
    from seakeep.models import is_ensemble

    ensembles = [each for each in models.values() if is_ensemble(each)]
    given = {"--level": level, "--band": band}
    if not ensembles:
        alone = FOR_ENSEMBLES.format(", ".join(models))
        refuse(given | {"--members": members, "--scheduler": scheduler}, alone)
    if members:
        refuse(given, NO_BAND)
    calibrations = [each.calibration for each in ensembles if each.calibration]
    if calibrations and not (band or members):
        say(
            "Note: the ensemble is calibrated, and the band shown is that of its members. "
            "--band calibrated shows the calibrated one."
        )
    if level is None:
        level = (
            calibrations[0].conformal.level
            if calibrations and band == "calibrated"
            else DEFAULT_LEVEL
        )
    return {"level": level, "band": band or "members"}


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
    It names the checks that these runs do not allow, with the reason. All is at model scale, but
    for the extreme of three hours at full scale.

    Example: seakeep check model.nc docs/tutorial/campaign.toml -o check
    """
    from seakeep.campaign import load_prepared, read_campaign
    from seakeep.check import check_model
    from seakeep.models import load_model
    from seakeep.models.forecasts import counted
    from seakeep.report.check_page import check_sections
    from seakeep.report.page import write_page
    from seakeep.study import fit_baselines
    from seakeep.study.fit import repeats_of

    make_folder(out)
    identified = load_model(model)
    read = read_campaign(campaign)
    check_output(out / "report.html", "report", read_files(read, model))
    check_report(out)
    states, inputs = identified.states, identified.inputs
    with progress_bar("Preparing") as progress:
        used = [*states, *inputs]
        runs = load_prepared(read, names=run or None, progress=progress, channels=used)
    try:
        prepared = None if run else runs
        baselines = fit_baselines(read, states, inputs, prepared=prepared, beside=identified)
    except SeakeepError as error:
        say(f"Note: no baselines to compare with: {error}")
        baselines = {}
    with progress_bar("Checking") as progress:
        checked = check_model(identified, runs, progress, baselines)
    checked = replace(checked, repeats=repeats_of(identified, read, runs))
    sections = check_sections(checked)
    for section in sections:
        for text in (*section.points, *section.notices):
            show(f"{section.title}: {text}")
    size = f"{counted(len(states), 'state')}, {counted(len(inputs), 'input')}"
    words = f"{model.name}, a model of kind {identified.kind} ({size}), on {read.name}."
    title = f"{model.stem}: what the model is worth"
    say(f"Wrote {write_page(out, title, {'description': words}, sections)}.")


def study(
    study_file: Annotated[Path, Argument(help="Study file.", metavar="STUDY.toml")],
    out: Annotated[
        Path | None, Option("-o", "--out", help="Folder; by default named after the study file.")
    ] = None,
    workers: AllCores = None,
    scheduler: Scheduler = None,
) -> None:
    """Run a study and write its report.

    Each model is fitted on each training set and judged in each test window. After an
    interruption, the same command continues the study.

    Example: seakeep study examples/ntnu_ship_section/study.toml -o ship-study
    """
    from seakeep.report.sections.results import findings, overview_table
    from seakeep.study import read_study, run_study

    asked = read_study(study_file)
    folder = out or study_file.parent / f"{study_file.stem}-results"
    with executor_of(workers, scheduler, cores()) as executor:
        with progress_bar("Study") as tell:
            result = run_study(asked, folder, executor=executor, progress=tell)
        page = _write_study(result, executor)
    print_table(overview_table(result), note=False)
    for text in findings(result):
        show(text)
    show(f"\nReport: {page}")


def _write_study(result: StudyResult, executor: Executor | None = None) -> Path:
    from seakeep.report.sections import write_report

    with progress_bar(f"Report of {result.attrs['study']}") as tell:
        return write_report(result, tell, executor)


def reproduce(
    out: Annotated[Path, Option("--out", "-o", help="Output folder.")] = Path("reproduction"),
    quick: Annotated[
        bool, Option("--quick", help="All stages with small counts, in half of the time.")
    ] = False,
    preset: Annotated[Preset | None, Option(help="The acts of this preset alone.")] = None,
    seed: Annotated[
        int, Option(help="Seed of waves, noise, windows, draws.", min=0, max=2**64 - 1)
    ] = 0,
    workers: AllCores = None,
    scheduler: Scheduler = None,
) -> None:
    """Reproduce the paper's study on the virtual tank, in three acts.

    Simulates six runs, and runs three studies of them: the paper's procedure, the same on channels
    with their slow drift, and the recommended model. Writes statistics, figures, tables and a
    report.

    Example: seakeep reproduce --quick --out quick
    """
    from seakeep.report.acts import finding, short_table
    from seakeep.study.reproduce import ACTS, Size
    from seakeep.study.reproduce import reproduce as reproduce_study

    with executor_of(workers, scheduler, cores()) as executor:
        with progress_bar("Study") as tell:
            results = reproduce_study(
                out,
                preset,
                size=Size.quick() if quick else Size(),
                seed=seed,
                executor=executor,
                progress=tell,
            )
        page = _write_reproduction(out, results, executor)
    print_table(short_table(results))
    show(finding(results))
    for act in ACTS:
        if act.name in results:
            show(f"{act.title}: {act.sentence}")
    show(f"\nReport: {page}")


def report(
    folder: Annotated[Path, Argument(help="Folder of a study's results.", metavar="DIR")],
) -> None:
    """Write the report of a finished study.

    One HTML file, figures, and tables.

    Example: seakeep report reproduction
    """
    from seakeep.study import read_result
    from seakeep.study.reproduce import read_reproduction

    if acts := read_reproduction(folder):
        page = _write_reproduction(folder, acts)
    else:
        page = _write_study(read_result(folder))
    typer.echo(str(page))


def _write_reproduction(
    folder: Path, results: dict[str, StudyResult], executor: Executor | None = None
) -> Path:
    """Write the pages of the acts, and the one over all."""
    from seakeep.report.acts import write_reproduction

    for each in results.values():
        _write_study(each, executor)
    with progress_bar("Report") as tell:
        return write_reproduction(folder, results, tell)
