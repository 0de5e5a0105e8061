"""Checks of a model: worth, response, coherence, modes, residuals, statistics and validity."""

from seakeep.check.coherence import coherence
from seakeep.check.every import CHECKS, Checked, check_model
from seakeep.check.motion import decay, drift, measured_decay, modes
from seakeep.check.peaks import statistics
from seakeep.check.residuals import residuals
from seakeep.check.response import measured_response, response, validation
from seakeep.check.sea import validity
from seakeep.check.worth import worth

__all__ = [
    "CHECKS",
    "Checked",
    "check_model",
    "coherence",
    "decay",
    "drift",
    "measured_decay",
    "measured_response",
    "modes",
    "residuals",
    "response",
    "statistics",
    "validation",
    "validity",
    "worth",
]
