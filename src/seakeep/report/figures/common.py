"""Shared parts of a study's figures: colours of models, labels of channels, helpers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from seakeep.conventions import canonical_channel
from seakeep.report.style import COLOURS, LINES, PALETTE
from seakeep.study import StudyResult

__all__ = [
    "HEADING",
    "grid_of_axes",
    "judged_models",
    "legend_outside",
    "line_of",
    "model_colour",
    "model_words",
    "short_label",
]


FURTHER = tuple(
    PALETTE[name] for name in ("pink", "amber", "green", "sky", "brown", "slate", "violet")
)
HEADING = {"nrmse": "ANRMSE", "nammae": "NAMMAE"}
"""Names of the paper for the averages of the two measures over the channels."""


def judged_models(result: StudyResult) -> list[str]:
    """Models that are no references; all models if there is no other."""
    own = [m for m in result.models if result.model_settings[m].get("role") != "reference"]
    return own or result.models


def model_colour(result: StudyResult, model: str) -> str:
    """Colour of a model: that of a forecast, of an ensemble, or one of its own beyond the first."""
    ensemble = result.is_ensemble(model)
    first = {kind: [m for m in result.models if result.is_ensemble(m) == kind][:1]
             for kind in (False, True)}  # fmt: skip
    if [model] == first[ensemble]:
        return COLOURS["ensemble" if ensemble else "forecast"]
    others = [name for name in result.models if [name] not in first.values()]
    return FURTHER[others.index(model) % len(FURTHER)]


def line_of(result: StudyResult, model: str) -> dict[str, Any]:
    """Line style of a model."""
    key = "ensemble" if result.is_ensemble(model) else "forecast"
    return {**LINES[key], "color": model_colour(result, model)}


def model_words(model: str) -> str:
    """Name of a model for legends.

    Examples
    --------
    >>> model_words("bayesian"), model_words("hold_last"), model_words("fir")
    ('Bayesian', 'hold last', 'FIR')
    """
    known = {"bayesian": "Bayesian", "fir": "FIR", "arx": "ARX"}
    return known.get(model, model.replace("_", " "))


def short_label(channel: str) -> str:
    r"""Symbol of a channel for a crowded axis, else its name.

    Examples
    --------
    >>> short_label("pitch_rate"), short_label("torque")
    ('$\\dot{\\theta}$', 'torque')
    """
    known = canonical_channel(channel)
    return f"${known.symbol}$" if known else channel.replace("_", " ")


def grid_of_axes(figure: Any, count: int, most: int) -> list[Any]:
    """Axes in rows of `most`, or of fewer that fill as few rows; empty places are taken away."""
    rows = -(-count // most)
    columns = -(-count // rows)
    axes: Sequence[Any] = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for spare in axes[count:]:
        spare.remove()
    return list(axes[:count])


def legend_outside(figure: Any, *places: Any, side: str = "lower center", **options: Any) -> Any:
    """Legend beside all panels of what some of them label, in as many columns as fit."""
    unique: dict[str, Any] = {}
    for place in places:
        handles, labels = place.get_legend_handles_labels()
        unique |= dict(zip(labels, handles, strict=True))
    if not unique:
        return None
    across = max(1, int(13 * figure.get_figwidth() / (6 + max(map(len, unique)))))  # letters
    columns = min(len(unique), across)
    loc = f"outside {side}"
    return figure.legend(unique.values(), unique, loc=loc, ncols=columns, **options)
