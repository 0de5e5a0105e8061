"""Eigenvalues of the models, in the complex plane and as frequency and decay."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from seakeep.report.figures.common import judged_models, legend_outside, model_colour, model_words
from seakeep.report.style import PALETTE, figure_style, new_figure
from seakeep.study import StudyResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["LOWEST", "eigenvalue_figure"]


LOWEST = 0.8
"""Modulus at which the axis ends; what lies below dies out within a few samples."""


def eigenvalue_figure(result: StudyResult) -> Figure:
    """Eigenvalues of each model of the first training set, for an ensemble those of all members."""
    with figure_style():
        figure = new_figure(8.5, 3.0)
        plane, decay = figure.subplots(1, 2)
        circle = np.exp(1j * np.linspace(0, np.pi, 400))
        plane.plot(circle.real, circle.imag, color=PALETTE["slate"], linewidth=0.8)
        order = sorted(judged_models(result), key=lambda model: not result.is_ensemble(model))
        for model in order:
            data = result.groups[f"eigenvalues/{model}"]
            values = (data["real"].values + 1j * data["imag"].values).ravel()
            values = values[np.isfinite(values) & (values.imag >= 0)]
            _draw(plane, decay, values, result, model)
        plane.set_aspect("equal")
        plane.set_ylim(0, 1.05)
        plane.set_xticks([-1.0, -0.5, 0.0, 0.5, 1.0])
        plane.set(xlabel="real part", ylabel="imaginary part")
        decay.axhline(1.0, color=PALETTE["slate"], linewidth=0.8)
        decay.set(xlabel="frequency [Hz]", ylabel="modulus")
        decay.set_xlim(0, 3 / float(result.attrs["encounter_period"]))
        decay.set_ylim(LOWEST, 1.01)
        legend = legend_outside(figure, decay, side="upper right", markerscale=2)
        for handle in filter(None, legend.legend_handles):
            handle.set_alpha(0.9)
        return figure


def _draw(plane: Any, decay: Any, values: Any, result: StudyResult, model: str) -> None:
    single = not result.is_ensemble(model)
    members = result.groups[f"eigenvalues/{model}"].sizes["member"]
    style = {
        "s": 9 if single else 5,
        "color": model_colour(result, model),
        "alpha": 0.9 if single else float(np.clip(12 / members, 0.12, 0.6)),
        "linewidths": 0,
        "rasterized": True,
        "label": model_words(model),
    }
    plane.scatter(values.real, values.imag, **style)
    frequency = np.angle(values) / (2 * np.pi * float(result.attrs["dt"]))
    decay.scatter(frequency, np.abs(values), **style)
