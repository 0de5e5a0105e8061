"""Figures of labelled results: each function returns a matplotlib Figure, or draws on given Axes.

Forecasts: :func:`overlay`, :func:`band`, :func:`errors`. Results of :mod:`seakeep.check`:
:func:`response`, :func:`coherence`, :func:`decay`, :func:`modes`, :func:`residuals`,
:func:`exceedance`, :func:`density`, :func:`validity`, :func:`drift`.
"""

from seakeep.report.figures.checks import (
    coherence,
    decay,
    density,
    drift,
    exceedance,
    modes,
    residuals,
    response,
    validity,
)
from seakeep.report.figures.errors import errors
from seakeep.report.figures.histories import band, overlay

__all__ = [
    "band",
    "coherence",
    "decay",
    "density",
    "drift",
    "errors",
    "exceedance",
    "modes",
    "overlay",
    "residuals",
    "response",
    "validity",
]
