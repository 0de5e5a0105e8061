"""Models: what is identified from prepared runs, and what it forecasts."""

import warnings
from dataclasses import asdict, replace
from pathlib import Path

from seakeep.errors import DataError, SeakeepWarning
from seakeep.models import store
from seakeep.models.alignment import FittedAlignment, ProbeAlignment
from seakeep.models.hankel import HankelDMDc
from seakeep.models.model import HankelDMDcModel
from seakeep.models.offsets import ProbeOffset, estimate_probe_offset

__all__ = [
    "FittedAlignment",
    "HankelDMDc",
    "HankelDMDcModel",
    "ProbeAlignment",
    "ProbeOffset",
    "estimate_probe_offset",
    "load_model",
]


def load_model(path: str | Path) -> HankelDMDcModel:
    """Read a model that was saved; no code from the file is run.

    Parameters
    ----------
    path : str or Path
        File written by ``model.save`` or ``seakeep fit``.

    Returns
    -------
    HankelDMDcModel
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
    if kind != store.HANKEL_DMDC:
        raise DataError(
            f"{path} holds a model of kind '{kind}', which this version does not know. "
            "Update seakeep."
        )
    try:
        model = HankelDMDcModel.from_dataset(dataset)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SeakeepWarning)  # given when the model was made
            return replace(model, settings=HankelDMDc(**asdict(model.settings)))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path} is incomplete: {error}. Save the model again.") from error
