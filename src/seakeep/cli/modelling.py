"""``seakeep fit``, ``forecast`` and ``compare``."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer
import xarray as xr

from seakeep.campaign import Campaign, load_prepared, read_campaign
from seakeep.cli.console import messages, progress_bar, results
from seakeep.errors import RequestError, did_you_mean
from seakeep.files import check_place, make_folder, replacing
from seakeep.models import HankelDMDcModel, load_model
from seakeep.report.overlay import overlay_figure
from seakeep.report.style import save_figure
from seakeep.report.tables import rich_comparison, write_csv
from seakeep.signals import to_full_scale
from seakeep.study import at_full_scale, comparison_table, fit_campaign, in_degrees
from seakeep.study import compare as compare_runs

__all__ = ["compare", "fit", "forecast"]

CampaignFile = Annotated[Path, typer.Argument(help="Campaign file.", metavar="CAMPAIGN.toml")]
FullScale = Annotated[
    bool,
    typer.Option(
        "--full-scale", help="Convert results by Froude's law with the campaign's scale factor."
    ),
]
ModelFile = Annotated[
    Path, typer.Argument(help="Model file written by seakeep fit.", metavar="MODEL.nc")
]


def fit(
    campaign: CampaignFile,
    out: Annotated[Path, typer.Option("-o", "--out", help="Model file to write (NetCDF).")],
    model: Annotated[
        str | None,
        typer.Option("--model", help="Key in [models.NAME]; by default the table [model]."),
    ] = None,
) -> None:
    """Identify a model from the training runs of a campaign.

    Example: seakeep fit docs/tutorial/campaign.toml -o model.nc
    """
    check_place(out)
    with progress_bar("Preparing") as progress:
        identified = fit_campaign(read_campaign(campaign), model, progress)
    typer.echo(identified.summary())
    identified.save(out)
    messages().print(f"Wrote {out}. Judge it with: seakeep compare {out} {campaign}")


def forecast(
    model: ModelFile,
    campaign: CampaignFile,
    run: Annotated[str, typer.Option("--run", help="Name of the run.")],
    start: Annotated[float, typer.Option("--start", help="Instant of the last measured state, s.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Result: .nc or .csv.")],
    steps: Annotated[
        int | None, typer.Option("--steps", help="Number of instants; by default to the end.")
    ] = None,
    full_scale: FullScale = False,
) -> None:
    """Forecast a run: the model runs freely after START, driven by the measured waves.

    Example: seakeep forecast model.nc docs/tutorial/campaign.toml --run unseen --start 20
    --steps 400 -o forecast.csv
    """
    if out.suffix not in (".nc", ".csv"):
        raise RequestError(f"{out} ends in '{out.suffix}'; a forecast is written as .nc or .csv.")
    identified = load_model(model)
    read = read_campaign(campaign)
    result = identified.forecast(_prepared(read, run), start=start, steps=steps)
    if full_scale:
        result = to_full_scale(result, read.settings.campaign.scale_factor)
    with replacing(out) as temporary:
        if out.suffix == ".nc":
            result.to_netcdf(temporary, engine="h5netcdf")
        else:
            _with_units(result).to_dataframe().to_csv(temporary)
    status = result.attrs["status"]
    messages().print(
        f"Wrote {out}: {result.sizes['time']} instants after t = {result.attrs['start']:.10g} s, "
        f"status {status}."
    )
    if status != "ok":
        raise typer.Exit(1)


def compare(
    model: ModelFile,
    campaign: CampaignFile,
    run: Annotated[
        list[str] | None,
        typer.Option("--run", help="Name of a run (repeatable); by default the test runs."),
    ] = None,
    start: Annotated[
        float | None,
        typer.Option(
            "--start",
            help="Instant of the last measured state, s; by default the first possible one.",
        ),
    ] = None,
    steps: Annotated[
        int | None, typer.Option("--steps", help="Number of instants; by default to the end.")
    ] = None,
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder for the table and the figures.")
    ] = Path("comparison"),
    format_: Annotated[
        str, typer.Option("--format", help="Format of the figures: png, svg or pdf.")
    ] = "png",
    radians: Annotated[
        bool, typer.Option("--radians", help="Show angles in radians instead of degrees.")
    ] = False,
    full_scale: FullScale = False,
) -> None:
    """Forecast test runs and judge the forecasts against the measurement.

    Prints a table a channel and writes it as CSV, with an overlay figure a run.

    Example: seakeep compare model.nc docs/tutorial/campaign.toml -o comparison
    """
    if format_ not in ("png", "svg", "pdf"):
        raise RequestError(f"--format must be png, svg or pdf; received '{format_}'.")
    identified = load_model(model)
    if not isinstance(identified, HankelDMDcModel):
        raise RequestError(
            f"{model} holds an ensemble; compare judges a single model. Forecast the ensemble with "
            "`seakeep forecast`, or save one member with ensemble.member(0).save(...)."
        )
    with progress_bar("Preparing") as progress:
        read = read_campaign(campaign)
        comparisons = compare_runs(identified, read, run or (), start, steps, progress)
    if full_scale:
        scale = read.settings.campaign.scale_factor
        comparisons = [at_full_scale(each, scale) for each in comparisons]
    if not radians:
        comparisons = [in_degrees(each) for each in comparisons]
    table = comparison_table(comparisons)
    results().print(rich_comparison(table))
    make_folder(out)
    written = [write_csv(table, out / "comparison.csv")]
    if find_spec("matplotlib") is None:
        messages().print(
            "Note: no figures, because matplotlib is not installed. "
            "Install it with: pip install 'seakeep[figures]'"
        )
    else:
        for comparison in comparisons:
            path = out / f"{comparison.run}.{format_}"
            written.append(save_figure(overlay_figure(comparison), path))
    messages().print("Wrote " + ", ".join(map(str, written)))
    if any(comparison.status != "ok" for comparison in comparisons):
        raise typer.Exit(1)


def _prepared(campaign: Campaign, run: str) -> xr.Dataset:
    known = list(campaign.settings.runs)
    if run not in known:
        raise RequestError(
            f"the campaign has no run '{run}'.{did_you_mean(run, known)} Runs: {', '.join(known)}."
        )
    return load_prepared(campaign, names=[run])[run]


def _with_units(result: xr.Dataset) -> xr.Dataset:
    names = {
        str(name): f"{name} [{variable.attrs.get('units', '')}]"
        for name, variable in result.data_vars.items()
    }
    # Instants are multiples of a step; nine decimals hide the rounding of the product.
    timed = result.assign_coords(time=result["time"].round(9))
    return timed.rename({**names, "time": "time [s]"})
