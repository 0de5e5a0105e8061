"""Models identified from prepared runs, ensembles of them, and their forecasts."""

from seakeep.executor import processes
from seakeep.models.alignment import FittedAlignment, ProbeAlignment
from seakeep.models.conditions import ProbeOffset, estimate_probe_offset
from seakeep.models.ensemble import BandForecast, HankelEnsemble
from seakeep.models.forecasts import Model, Spec, summarize
from seakeep.models.inputs import InputMap, Signature
from seakeep.models.labelled import ChannelLabel
from seakeep.models.linear import HankelDMDcModel
from seakeep.models.live import Live, load_live
from seakeep.models.observables import OBSERVABLES, Expression, Powers, SlowSquares
from seakeep.models.readouts import FittedReadOut
from seakeep.models.registry import KINDS, is_ensemble, load_model
from seakeep.models.settings import LogUniform, Needs, Select, Uniform
from seakeep.models.specs import BayesianHankelDMDc, HankelDMDc
from seakeep.models.terms import Bound
from seakeep.models.validity import outside_training

__all__ = [
    "KINDS",
    "OBSERVABLES",
    "BandForecast",
    "BayesianHankelDMDc",
    "Bound",
    "ChannelLabel",
    "Expression",
    "FittedAlignment",
    "FittedReadOut",
    "HankelDMDc",
    "HankelDMDcModel",
    "HankelEnsemble",
    "InputMap",
    "Live",
    "LogUniform",
    "Model",
    "Needs",
    "Powers",
    "ProbeAlignment",
    "ProbeOffset",
    "Select",
    "Signature",
    "SlowSquares",
    "Spec",
    "Uniform",
    "estimate_probe_offset",
    "is_ensemble",
    "load_live",
    "load_model",
    "outside_training",
    "processes",
    "summarize",
]
