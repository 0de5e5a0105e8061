"""Tables of the virtual tank: its test matrix, realised waves, and true motions and loads."""

from __future__ import annotations

import numpy as np

from seakeep.report.tables import Table
from seakeep.tank.realised import Realised, comparison, matrix_rows
from seakeep.tank.settings import TankSettings

__all__ = ["realised_tables"]


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
