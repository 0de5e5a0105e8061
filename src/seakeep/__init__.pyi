from . import campaign, core, metrics, models, quality, report, signals, statistics, study, tank
from .campaign import Campaign, read_campaign
from .errors import DataError, RequestError, SeakeepError, SeakeepWarning
from .models import (
    BayesianHankelDMDc,
    Fixed,
    HankelDMDc,
    HankelDMDcModel,
    HankelEnsemble,
    LogUniform,
    ProbeAlignment,
    Uniform,
    estimate_probe_offset,
    load_model,
    summarize,
)

__version__: str

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
    "campaign",
    "core",
    "estimate_probe_offset",
    "load_model",
    "metrics",
    "models",
    "quality",
    "read_campaign",
    "report",
    "signals",
    "statistics",
    "study",
    "summarize",
    "tank",
]
