"""``seakeep tune``."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from seakeep.cli.console import (
    CampaignFile,
    ModelKey,
    Scheduler,
    Workers,
    member_executor,
    progress_bar,
    read_files,
    say,
)
from seakeep.errors import RequestError
from seakeep.files import check_output, check_place, replacing


def tune(
    campaign: CampaignFile,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="What to choose beside the ridge: observables, lead, input_delays, state_delays, "
            "memory, alignment, readouts, kind (FIR, ARX and subspace models too). Repeat it for "
            "several. Default: observables, which are chosen too where the file leaves them open.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
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
    from seakeep.report.comparison import plain_cells
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
    with member_executor(workers, scheduler) as executor, progress_bar("Tuning") as progress:
        search_result = search(
            replace(spec, select=chosen),
            runs,
            list(settings.states),
            list(settings.inputs),
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
    with replacing(target) as place:
        varied = {*vary, *chosen.opened}
        text = tuned_campaign(
            before, model, search_result.spec, varied, preset_of(settings), samples
        )
        place.write_text(text, encoding="utf-8")
    scores.unlink(missing_ok=True)
    say(f"Wrote {target}. Fit it with: seakeep fit {target} -o model.nc")
    if not search_result.table.sizes["trial"]:
        return
    with replacing(tried) as place:
        plain_cells(search_result.table.to_dataframe()).to_csv(place, index=False)
    say(f"Wrote {tried}: all that was tried.")
    if find_spec("matplotlib"):
        from seakeep.report.style import save_figure

        say(f"Wrote {save_figure(search_result.figure(), picture)}.")
