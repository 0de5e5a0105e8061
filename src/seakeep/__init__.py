"""Data-driven models of vessels in waves: Hankel dynamic mode decomposition with control."""

from importlib import metadata

from seakeep import core, metrics, signals, statistics
from seakeep.campaign import Campaign, read_campaign
from seakeep.errors import DataError, RequestError, SeakeepError, SeakeepWarning
from seakeep.models import (
    BayesianHankelDMDc,
    Fixed,
    HankelDMDc,
    HankelDMDcModel,
    HankelEnsemble,
    LogUniform,
    ProbeAlignment,
    Uniform,
    choose_alignment,
    estimate_probe_offset,
    load_model,
    summarize,
)

__version__ = metadata.version("seakeep")

__all__ = [
    "BayesianHankelDMDc",
    "Campaign",
    "DataError",
    "Fixed",
    "HankelDMDc",
    "HankelDMDcModel",
    "HankelEnsemble",
    "LogUniform",
    "ProbeAlignment",
    "RequestError",
    "SeakeepError",
    "SeakeepWarning",
    "Uniform",
    "choose_alignment",
    "core",
    "estimate_probe_offset",
    "load_model",
    "metrics",
    "read_campaign",
    "signals",
    "statistics",
    "summarize",
]
