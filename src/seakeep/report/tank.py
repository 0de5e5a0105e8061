"""Tables and figures of the virtual tank: test matrix, waves, true motions and loads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from seakeep.report.figures.runs import hydrodynamics_figure, run_figure, tank_spectrum_figure
from seakeep.report.style import save_figure
from seakeep.report.tables import Table
from seakeep.tank.dynamics import Rig
from seakeep.tank.play import play_run, truth
from seakeep.tank.realised import Realised, comparison, matrix_rows
from seakeep.tank.settings import TankSettings


def realised_tables(settings: TankSettings, realised: list[Realised]) -> list[Table]:
    """Test matrix, realised waves beside the paper's, and statistics of the true channels."""
    matrix = matrix_rows(settings, realised)
    cells = [tuple(row.values()) for row in matrix]
    waves = [
        (name, unit, *(f"{value:.3f}" for value in (here, paper, tolerance)), verdict)
        for name, unit, here, paper, tolerance in comparison(settings, realised).itertuples()
        for verdict in ("within" if abs(here - paper) <= tolerance else "outside",)
    ]
    motions = [
        (each.run, channel, f"{round(mean, 4) + 0.0:.4f}", f"{spread:.4f}", share)
        for each in realised
        for channel, mean, spread, slack in each.motions.itertuples()
        for share in ("" if np.isnan(slack) else f"{100 * slack:.0f} %",)
    ]
    known = ("", "unit", "here", "paper", "tolerance", "")
    true = ("run", "channel", "mean", "SD", "slack")
    return [
        Table("matrix", "Test matrix", tuple(matrix[0]), cells, numeric=(0, 2, 3, 5)),
        Table("waves", "Realised waves, forward probe", known, waves, numeric=(2, 3, 4)),
        Table("truth", "True motions and loads", true, motions, numeric=(2, 3, 4)),
    ]


def write_tank_figures(
    settings: TankSettings, rig: Rig, realised: Sequence[Realised], folder: Path
) -> list[Path]:
    """Draw coefficients, spectrum (where a sea is irregular) and each run into a folder."""
    drawn = {"hydrodynamics": hydrodynamics_figure(rig, settings)}
    if any(each.irregular for each in realised):
        drawn["spectrum"] = tank_spectrum_figure(settings, realised)
    for each in realised:
        drawn[f"run_{each.run}"] = run_figure(
            truth(play_run(settings, each.run, rig), each.run, 0.02)
        )
    return [save_figure(figure, folder / f"{name}.png") for name, figure in drawn.items()]
