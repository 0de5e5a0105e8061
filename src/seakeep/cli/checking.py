"""``seakeep check``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from seakeep.cli.console import progress_bar, say, show
from seakeep.cli.options import CampaignFile, ModelFile, read_files
from seakeep.errors import SeakeepError
from seakeep.files import check_output, check_report, make_folder


def check(
    model: ModelFile,
    campaign: CampaignFile,
    run: Annotated[
        list[str] | None,
        typer.Option(help="Name of a run (repeatable); by default all that a check can use."),
    ] = None,
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder for the page, its figures and tables.")
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
    from seakeep.quality import warn_of_runs
    from seakeep.report.check_page import check_sections, write_check
    from seakeep.study import fit_baselines
    from seakeep.study.fit import repeats_of

    make_folder(out)
    identified = load_model(model)
    read = read_campaign(campaign)
    check_output(out / "report.html", "report", read_files(read, model))
    check_report(out)
    with progress_bar("Preparing") as progress:
        runs = load_prepared(read, names=run or None, progress=progress)
    warn_of_runs(runs.values(), [*identified.states, *identified.inputs])
    try:
        channels = (identified.states, identified.inputs)
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
