"""Time histories: figures, and data for the interactive plot, packed small."""

from __future__ import annotations

import base64
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from seakeep.conventions import displayed
from seakeep.report.figures.common import line_of, model_colour, model_words
from seakeep.report.figures.histories import history_figure, shown_cells
from seakeep.report.section import Drawing, Section
from seakeep.report.style import shown_unit
from seakeep.study import StudyResult

__all__ = ["explorer", "histories", "history_data", "pack"]

MOST_MEMBERS = 40
"""Members of a cell that are embedded; more cannot be told apart on a screen."""
MISSING = 65535


def explorer(result: StudyResult) -> Section | None:
    """Return the interactive plot of the cells that are shown."""
    data = history_data(result)
    return Section("explore", "Time histories, interactive", histories=data) if data else None


def histories(result: StudyResult) -> Section | None:
    """Return figures of the cells that are shown."""
    level = 100 * float(result.settings["statistics"]["level"])
    edges = ", and that band calibrated (dotted)" if result.is_calibrated else ""
    figures = tuple(
        Drawing(
            f"history_{test}_{window:03d}",
            f"Time histories, {result.label_of(test)}: deviations from the training mean in "
            "training standard deviations; measured, deterministic forecast, and the ensemble's "
            f"mean with its {level:g} % band{edges}.",
            partial(history_figure, result, test, training, window),
        )
        for test, training, window in shown_cells(result)
    )
    return Section("histories", "Time histories", figures=figures) if figures else None


def pack(values: npt.ArrayLike) -> dict[str, Any]:
    """Pack numbers as 16-bit integers between their bounds, base64; NaN has a code of its own.

    Examples
    --------
    >>> packed = pack([0.0, 1.0, float("nan")])
    >>> packed["low"], packed["high"], packed["data"]
    (0.0, 1.0, 'AAD+////')
    """
    x = np.asarray(values, dtype=float).ravel()
    known = np.isfinite(x)
    low, high = (float(f(x[known])) for f in (np.min, np.max)) if known.any() else (0.0, 1.0)
    step = (high - low) / (MISSING - 1) or 1.0
    codes = np.full(x.size, MISSING, dtype="<u2")
    codes[known] = np.rint((x[known] - low) / step).astype("<u2")
    return {"low": low, "high": high, "data": base64.b64encode(codes.tobytes()).decode()}


def history_data(result: StudyResult) -> list[dict[str, Any]]:
    """Cells that are shown: labels, time step, and per channel measurement and forecasts."""
    return [_cell(result, *place) for place in shown_cells(result)]


def _cell(result: StudyResult, test: str, training: int, window: int) -> dict[str, Any]:
    data = result.tests[test]
    cell = data.isel(training=training, window=window)
    shown = data["shown"].values.tolist() if "shown" in data else []
    row = shown.index(window) if window in shown else None
    run, start = str(cell["run"].values), float(cell["start"])
    return {
        "label": f"{result.label_of(test)}: {run} from {start:.1f} s",
        "note": f"Trained on {cell['training'].values}. Move over the plot for values.",
        "step": float(result.attrs["dt"]),
        "steps": int(cell.sizes["time"]),
        "channels": [
            _channel(result, cell, data, row, column, name)
            for column, name in enumerate(result.channels)
        ],
    }


def _channel(
    result: StudyResult, cell: Any, data: Any, row: int | None, column: int, name: str
) -> dict[str, Any]:
    channels = result.groups["channels"].sel(name=name)
    factor, target = displayed(str(channels["units"].values))
    models = []
    for model in result.models:
        ensemble = result.is_ensemble(model)
        style = line_of(result, model)["linestyle"]
        entry: dict[str, Any] = {
            "label": f"{model_words(model)} mean" if ensemble else model_words(model),
            "colour": model_colour(result, model),
            "dash": [] if isinstance(style, str) else list(style[1]),
            "mean": pack(factor * cell[f"{model}_mean"].values[:, column]),
        }
        if ensemble:
            for bound in ("lower", "upper"):
                entry[bound] = pack(factor * cell[f"{model}_{bound}"].values[:, column])
            if row is not None and f"{model}_members" in data:
                members = data[f"{model}_members"].values[row, :MOST_MEMBERS, :, column]
                entry["members"] = pack(factor * members.astype(float))
        models.append(entry)
    return {
        "name": name,
        "label": result.words_of(name),
        "unit": shown_unit(target),
        "measured": pack(factor * cell["measured"].values[:, column]),
        "models": models,
    }
