"""Models: what is identified from prepared runs, and what it forecasts."""

import warnings
from dataclasses import asdict, replace
from pathlib import Path

from seakeep.errors import DataError, SeakeepWarning
from seakeep.models import ensemble_store, store
from seakeep.models.alignment import FittedAlignment, ProbeAlignment
from seakeep.models.ensemble import BayesianHankelDMDc
from seakeep.models.executor import processes
from seakeep.models.fitted_ensemble import HankelEnsemble
from seakeep.models.hankel import HankelDMDc
from seakeep.models.held import BandForecast, HeldEnsemble
from seakeep.models.model import HankelDMDcModel
from seakeep.models.offsets import ProbeOffset, estimate_probe_offset
from seakeep.models.priors import Fixed, LogUniform, Uniform
from seakeep.models.summaries import summarize

__all__ = [
    "BandForecast",
    "BayesianHankelDMDc",
    "FittedAlignment",
    "Fixed",
    "HankelDMDc",
    "HankelDMDcModel",
    "HankelEnsemble",
    "HeldEnsemble",
    "LogUniform",
    "ProbeAlignment",
    "ProbeOffset",
    "Uniform",
    "estimate_probe_offset",
    "load_model",
    "processes",
    "summarize",
]


def load_model(path: str | Path) -> HankelDMDcModel | HankelEnsemble:
    """Read a model or an ensemble that was saved; no code from the file is run.

    Parameters
    ----------
    path : str or Path
        File written by ``model.save`` or ``seakeep fit``.

    Returns
    -------
    HankelDMDcModel or HankelEnsemble
        The model, equal to the last bit.

    Raises
    ------
    RequestError
        If there is no such file.
    DataError
        If it is damaged, not a model, or written by a newer version.
    """
    dataset = store.read(path)
    kind = dataset.attrs["seakeep_kind"]
    try:
        if kind == store.HANKEL_DMDC:
            model = HankelDMDcModel.from_dataset(dataset)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SeakeepWarning)  # given when the model was made
                return replace(model, settings=HankelDMDc(**asdict(model.settings)))
        if kind == ensemble_store.BAYESIAN_HANKEL_DMDC:
            return HankelEnsemble.from_dataset(dataset)
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path} is incomplete: {error}. Save the model again.") from error
    raise DataError(
        f"{path} holds a model of kind '{kind}', which this version does not know. Update seakeep."
    )
