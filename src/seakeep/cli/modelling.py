"""``seakeep tune``, ``fit``, ``calibrate`` and ``export``."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from seakeep.cli.console import (
    DEFAULT_LEVEL,
    CampaignFile,
    Level,
    ModelFile,
    ModelKey,
    Scheduler,
    Workers,
    executor_of,
    print_table,
    progress_bar,
    read_files,
    say,
    show,
)
from seakeep.errors import RequestError
from seakeep.files import check_output, check_place, write_text

if TYPE_CHECKING:
    from seakeep.models import Model


def tune(
    campaign: CampaignFile,
    vary: Annotated[
        list[str] | None,
        Option(
            help="What to choose beside the ridge: observables, lead, input_delays, state_delays, "
            "memory, alignment, readouts, kind (FIR, ARX and subspace models too). Repeat it for "
            "several. Default: observables, which are chosen too where the file leaves them open."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        Option(
            "-o", "--out", help="Tuned campaign file, beside CAMPAIGN. Default: NAME_tuned.toml."
        ),
    ] = None,
    model: ModelKey = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Choose settings by free runs on held-out training runs.

    Each candidate is fitted to all training runs but one and judged by free runs on that one.
    The choice is written into a copy of the campaign file, and all that was tried into a CSV file
    beside it. After an interruption, the same command continues the search.

    Example: seakeep tune docs/tutorial/campaign.toml --vary input_delays
    """
    from seakeep.campaign import read_campaign
    from seakeep.models import HankelDMDc, Select, labelled
    from seakeep.report.tables import write_frame
    from seakeep.study.fit import read_training
    from seakeep.study.resolve import counts_in_periods, preset_of
    from seakeep.tuning import tune as search
    from seakeep.tuning import tuned_campaign

    read = read_campaign(campaign)
    target = out or campaign.with_name(f"{campaign.stem}_tuned.toml")
    if target.resolve().parent != campaign.resolve().parent:
        raise RequestError(
            f"{target} lies in another folder than {campaign}, and paths in the file count from "
            "its folder. Write it beside the campaign file."
        )
    check_place(target, ".toml")
    picture, tried = target.with_suffix(".png"), target.with_suffix(".csv")
    for path, kind in ((target, "tuned campaign"), (picture, "figure"), (tried, "table")):
        check_output(path, kind, read_files(read), "state_delays,input_delays,lead,observables,")
    settings = read.model(model)
    if settings.kind != "hankel_dmdc":
        raise RequestError(
            f"kind = '{settings.kind}' cannot be tuned: a Hankel model is. Name another model with "
            "--model, or set kind = 'hankel_dmdc'. An ensemble chooses by itself: preset = "
            "'recommended'."
        )
    with progress_bar("Preparing") as progress:
        spec, _, runs, stop = read_training(read, model, progress)
    assert isinstance(spec, HankelDMDc)
    period = read.encounter_period() if counts_in_periods(settings) else None
    scores = target.with_suffix(".scores.json")
    chosen = spec.select or Select(period=period)
    vary = vary or ["observables"]
    with executor_of(workers, scheduler) as executor, progress_bar("Tuning") as progress:
        search_result = search(
            replace(spec, select=chosen),
            runs,
            settings.states,
            settings.inputs,
            vary=sorted({*vary}),
            horizon=chosen.horizon,
            folds=chosen.folds,
            stop=stop,
            executor=executor,
            progress=progress,
            resume=scores,
        )
    typer.echo(search_result.describe())
    samples = None if period is None else period / labelled.common_step(runs)
    before = campaign.read_text(encoding="utf-8")
    how = {*vary, *chosen.opened}, preset_of(settings), samples
    write_text(target, tuned_campaign(before, model, search_result.settings, *how))
    scores.unlink(missing_ok=True)
    say(f"Wrote {target}. Fit it with: seakeep fit {target} -o model.nc")
    if not search_result.table.sizes["trial"]:
        return
    say(f"Wrote {write_frame(search_result.table.to_dataframe(), tried)}: all that was tried.")
    if find_spec("matplotlib"):
        from seakeep.report.style import save_figure

        say(f"Wrote {save_figure(search_result.figure(), picture)}.")


def fit(
    campaign: CampaignFile,
    out: Annotated[Path, Option("-o", "--out", help="Model file to write (NetCDF).")],
    model: ModelKey = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Identify a model, or an ensemble, from a campaign.

    The table [model] of the campaign file states the kind of model and its settings;
    kind = 'bayesian_hankel_dmdc' is an ensemble. A table with states and inputs alone takes the
    preset recommended, which chooses settings on held-out training runs and prints what it tried.

    Example: seakeep fit docs/tutorial/campaign.toml -o model.nc

    An ensemble: seakeep fit docs/tutorial/campaign.toml --model ensemble -o ensemble.nc
    """
    check_place(out, ".nc")
    from seakeep.campaign import read_campaign
    from seakeep.models import is_ensemble
    from seakeep.study import fit_campaign

    read = read_campaign(campaign)
    check_output(out, "model", read_files(read))
    with executor_of(workers, scheduler) as executor:
        with progress_bar("Fitting") as progress:
            identified = fit_campaign(read, model, progress, executor=executor)
        if is_ensemble(identified):
            with progress_bar("Stability") as progress:
                identified.spectral_radii(executor=executor, progress=progress)
    typer.echo(identified.summary())
    identified.save(out)
    say(f"Wrote {out}. Judge it with: seakeep compare {out} {campaign}")


def calibrate(
    ensemble: Annotated[
        Path, Argument(help="Ensemble file written by seakeep fit.", metavar="ENSEMBLE.nc")
    ],
    campaign: CampaignFile,
    steps: Annotated[
        str,
        Option(
            help="Length of a window, as long as forecasts will be: a number of instants, or "
            "encounter periods such as '15 T'."
        ),
    ],
    out: Annotated[Path, Option("-o", "--out", help="Ensemble file to write (NetCDF).")],
    run: Annotated[
        list[str] | None, Option(help="Name of a run (repeatable); by default those that train.")
    ] = None,
    start: Annotated[
        str | None,
        Option(
            help="First instant used of each run, s or encounter periods such as '20 T'; '+300' is "
            "300 s after the start of each run; by default the start of its training span, or of "
            "the run."
        ),
    ] = None,
    stop: Annotated[
        str | None,
        Option(
            help="Last instant used of each run, s or encounter periods such as '40 T'; by default "
            "the end of its training span, or of the run."
        ),
    ] = None,
    level: Level = None,
    scale: Annotated[
        Literal["constant", "spread", "learnt"],
        Option(
            help="Half-width of the band: 'spread', a factor times that of the members with a "
            "floor, 'constant', the members' band moved outwards by the same amount everywhere, or "
            "'learnt' from spread, horizon and waves."
        ),
    ] = "spread",
    folds: Annotated[
        Literal["run"] | None,
        Option(
            help="'run': members trained on the runs of other waves forecast each training run; by "
            "default only windows that no member has read count."
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
    count = samples_of(steps, read, prepared[wanted[0]], fitted.dt, "--steps")
    with executor_of(workers, scheduler) as executor, progress_bar("Calibrating") as progress:
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
            "more windows make the margin surer."
        )
    say(f"Wrote {out}. Judge it elsewhere with: seakeep compare {out} {campaign} --band calibrated")


def export(
    model: ModelFile,
    c: Annotated[
        Path | None, Option(help="Folder for C99 sources: a library of two files.", metavar="DIR")
    ] = None,
    estimator: Annotated[
        bool, Option("--estimator", help="Of C99 sources and FMU: an estimator beside a vessel.")
    ] = False,
    fmu: Annotated[
        Path | None, Option(help="FMU 2.0 for co-simulation to write.", metavar="FILE.fmu")
    ] = None,
    onnx: Annotated[Path | None, Option(help="ONNX graph to write.", metavar="FILE.onnx")] = None,
    mat: Annotated[
        Path | None, Option(help="State-space system for MATLAB.", metavar="FILE.mat")
    ] = None,
    order: Annotated[
        int | None, Option(help="Order of the MATLAB system, by balanced truncation.", min=1)
    ] = None,
    steps: Annotated[
        int | None,
        Option(
            help="Instants that an ONNX graph, or an estimator's FMU, forecasts; by default 1.",
            min=1,
        ),
    ] = None,
    member: Annotated[
        int | None, Option(help="For an ensemble: the member to export, from 0.", min=0)
    ] = None,
    noise: Annotated[
        list[str] | None,
        Option(
            help="For an estimator: measurement noise of a state, SD in its unit (repeatable).",
            metavar="STATE=SD",
        ),
    ] = None,
    role: Annotated[
        list[str] | None,
        Option(
            help="For an estimator: an input that is no wave (repeatable): a plan that is known, "
            "or constant.",
            metavar="INPUT=known|constant",
        ),
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
        (noise or role, estimator, "--noise and --role belong to --estimator"),
    )
    service = _service(noise or [], role or [])
    if estimator and order:
        raise RequestError(
            "--order reduces the linear system of --mat; an estimator corrects measured states and "
            "their delays, which a reduced system no longer holds. Leave out --order, or "
            "--estimator."
        )
    for path, suffix in ((fmu, ".fmu"), (onnx, ".onnx"), (mat, ".mat")):
        if path:
            check_place(path, suffix)
    from seakeep.hosts import write_c, write_estimator, write_fmu, write_onnx
    from seakeep.hosts.program import exportable, timing

    linear = exportable(_single(model, member), estimator)
    written = []
    bound = ""
    if c:
        written += (
            write_estimator(linear, c, model.stem, *service)
            if estimator
            else write_c(linear, c, model.stem)
        )
    if fmu:
        written.append(write_fmu(linear, fmu, (steps or 1) if estimator else None, *service))
    if onnx:
        written.append(write_onnx(linear, onnx, steps or 1))
    if mat:
        written.append(linear.to_mat(mat, order))
        bound = _bound(mat) if order else ""
    say(f"Wrote {', '.join(map(str, written))}.{bound}")
    if fmu:
        say(_binary(fmu))
    say(timing(linear, estimator and not onnx and not mat))


def _service(noise: list[str], role: list[str]) -> tuple[dict[str, float], dict[str, str]]:
    """Noises and roles of an estimator."""
    try:
        noises, roles = (dict(each.split("=") for each in given) for given in (noise, role))
        return {name: float(sd) for name, sd in noises.items()}, roles
    except ValueError:
        raise RequestError(
            "--noise takes STATE=SD, such as heave=0.002, and --role INPUT=known or "
            f"INPUT=constant; received {', '.join(noise + role)}."
        ) from None


def _check_beside(*rules: tuple[object, object, str]) -> None:
    """Refuse an option that is given without the one that it belongs to."""
    for given, target, words in rules:
        if given and not target:
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
    from seakeep.hosts.c import compiler

    if compiler():
        return f"{fmu} holds a binary for this platform, and the sources for others."
    return (
        f"{fmu} holds sources alone: no C compiler was found (cc, gcc, clang, or CC). Export it "
        "where there is one, or with a host that compiles the sources."
    )


def _bound(mat: Path) -> str:
    """How far the reduced system of a file errs, as a sentence after another one."""
    from scipy.io import loadmat

    content = loadmat(mat, variable_names=["ErrorPeak", "ErrorBound", "A"])
    return (
        f" The system of order {len(content['A'])} errs by {content['ErrorPeak'].item():.3g} SD "
        "of its outputs per SD of its inputs at the worst frequency that was computed, and by "
        f"{content['ErrorBound'].item():.3g} at most at any."
    )
