"""Data-driven models of vessels in waves: Hankel dynamic mode decomposition with control."""

from importlib import metadata

from seakeep import core, metrics, signals
from seakeep.campaign import Campaign, read_campaign
from seakeep.errors import DataError, RequestError, SeakeepError, SeakeepWarning
from seakeep.models import (
    HankelDMDc,
    HankelDMDcModel,
    ProbeAlignment,
    estimate_probe_offset,
    load_model,
)

__version__ = metadata.version("seakeep")

__all__ = [
    "Campaign",
    "DataError",
    "HankelDMDc",
    "HankelDMDcModel",
    "ProbeAlignment",
    "RequestError",
    "SeakeepError",
    "SeakeepWarning",
    "core",
    "estimate_probe_offset",
    "load_model",
    "metrics",
    "read_campaign",
    "signals",
]
