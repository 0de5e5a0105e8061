"""Skill of models in service against lead time: a table, a CSV file and a figure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from seakeep.files import replacing
from seakeep.report.comparison import plain_cells
from seakeep.report.figures.common import FURTHER, grid_of_axes, legend_outside, short_label
from seakeep.report.style import PALETTE, figure_style, new_figure
from seakeep.report.tables import Table, number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["HEADER", "nowcast_blocks", "nowcast_figure", "write_nowcasts"]

HEADER = "model,run,channel,lead,error,claimed,coverage,lead_time"
"""First line of the CSV file."""
COLOURS = (PALETTE["blue"], *FURTHER)
STYLES = ("-", "--", "-.", ":")


def nowcast_blocks(found: Mapping[str, xr.Dataset]) -> Iterator[Table]:
    """Lead times and errors per channel, a table per model and run."""
    for model, of_model in found.items():
        for run in of_model["run"].values:
            at = of_model.sel(run=run)
            lead = at["lead"].values
            places = [max(round(len(lead) * part) - 1, 0) for part in (0.05, 0.2, 0.5, 1.0)]
            columns = ("channel", "lead time s", *(f"at {number(lead[p])} s" for p in places))
            rows = [
                (
                    str(name),
                    _lead_time(float(each["lead_time"]), float(lead[-1])),
                    *(number(each["error"][place]) for place in places),
                    f"{float(each['coverage'].mean()):.0f}",
                )
                for name in at["channel"].values
                for each in [at.sel(channel=name)]
            ]
            share, starts = float(of_model.attrs["share"]), int(of_model.attrs["starts"])
            note = (
                f"errors in training SD over {starts} forecasts, no wave after a start known; lead "
                f"time: error below {share:g} SD"
            )
            title = f"{run}: {model} in service"
            columns = (*columns, "in band %")
            numeric = range(1, len(columns))
            yield Table(f"nowcast_{model}_{run}", title, columns, rows, note, numeric)


def _lead_time(found: float, longest: float) -> str:
    """In words where the error was below the share as far as forecasts went."""
    return number(found) if found < longest - 1e-9 else f"at least {number(longest)}"


def write_nowcasts(found: Mapping[str, xr.Dataset], path: Path) -> Path:
    """Write all errors as CSV, a row per model, run, channel and lead, full precision."""
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8") as stream:
        stream.write(HEADER + "\n")
        for model, of_model in found.items():
            table = of_model[HEADER.split(",")[4:]].to_dataframe().reset_index()
            table.insert(0, "model", model)
            plain_cells(table[HEADER.split(",")]).to_csv(stream, index=False, header=False)
    return path


def nowcast_figure(found: Mapping[str, xr.Dataset], run: str) -> Figure:
    """Error, and the model's own estimate of it, against lead time, a panel per channel."""
    with figure_style():
        first = next(iter(found.values()))
        names = [str(each) for each in first["channel"].values]
        figure = new_figure(8.5, 0.9 + 1.7 * -(-len(names) // 4))
        panels = grid_of_axes(figure, len(names), 4)
        for axes, name in zip(panels, names, strict=True):
            for place, (model, of_model) in enumerate(found.items()):
                at = of_model.sel(run=run, channel=name)
                colour, style = COLOURS[place % len(COLOURS)], STYLES[place % len(STYLES)]
                lead = at["lead"].values
                axes.plot(lead, at["error"], style, color=colour, label=f"{model}: error")
                axes.plot(
                    lead, at["claimed"], color=colour, lw=0.7, alpha=0.7, label=f"{model}: claimed"
                )
            share = float(first.attrs["share"])
            axes.axhline(share, color="0.4", lw=0.8, ls=(0, (1, 2)), label=f"{share:g} SD")
            axes.set_title(short_label(name), loc="left", fontsize=8)
            drawn = [
                each[["error", "claimed"]].sel(run=run, channel=name) for each in found.values()
            ]
            highest = max(float(each.to_array().max()) for each in drawn)
            axes.set_ylim(0, 1.05 * max(highest, share))
            axes.set_xlim(0, float(np.max(first["lead"].values)))
            axes.set_xlabel("lead time [s]")
            if axes.get_subplotspec().is_first_col():
                axes.set_ylabel("error [training SD]")
        legend_outside(figure, panels[0], side="upper right")
        return figure
