"""Table of the margins of a calibrated band."""

from __future__ import annotations

import math

from seakeep.conventions import displayed
from seakeep.models import HankelEnsemble
from seakeep.models.forecasts import counted
from seakeep.report.tables import Table


def margins_table(ensemble: HankelEnsemble) -> Table:
    """Margins of the channels, or factors and floors of their scale, and what they rest on."""
    calibration = ensemble.calibration
    assert calibration is not None
    margin, windows, floor = calibration.conformal, calibration.windows, calibration.floor
    cells = {
        "constant": "Margin",
        "spread": "Factor k and floor f, ±k·√(σ² + f²),",
        "learnt": "Factor k of a learnt scale and its floor f",
    }[calibration.scale]
    width = margin.margin if floor is None else floor
    title = (
        f"{cells} of the {100 * margin.level:g} % band, from "
        f"{counted(sum(windows.values()), 'window')} of {calibration.steps} instants "
        f"({', '.join(windows)})"
    )
    rows = []
    for k, label in enumerate(ensemble.state_labels):
        factor, shown = displayed(label.units)
        rows.append(
            (
                label.name,
                shown,
                *([] if floor is None else [f"{margin.margin[k]:.2f}"]),
                f"{factor * width[k]:.4g}",
                f"{width[k] / ensemble.state_spread[k]:.3f}",
                f"{margin.blocks[k]:.0f}",
                f"{math.floor(1e4 * margin.warranted[k] + 1e-6) / 100:g}",
            )
        )
    names = ("margin",) if floor is None else ("k", "f")
    columns = ("channel", "unit", *names, "in SD", "blocks", "warranted %")
    return Table("margins", title, columns, tuple(rows), numeric=tuple(range(2, len(columns))))
