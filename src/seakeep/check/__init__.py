"""What a model is worth: its response to waves, and what its inputs can tell of a state at all."""

from seakeep.check.coherence import coherence
from seakeep.check.every import CHECKS, Checked, check_model
from seakeep.check.response import measured_response, response, validation

__all__ = [
    "CHECKS",
    "Checked",
    "check_model",
    "coherence",
    "measured_response",
    "response",
    "validation",
]
