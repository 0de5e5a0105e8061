"""Models as sealed files: JSON of settings beside arrays, and no code inside."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.errors import MissingFileError, RequestError
from seakeep.files import load_sealed
from seakeep.models.checks import Json, plain
from seakeep.models.inputs import InputMap
from seakeep.models.interface import Scale, Signature
from seakeep.models.labelled import ChannelLabel
from seakeep.models.readouts import FittedReadOut

MODEL = "model"
"""Kind of these files."""
SCALES = ("state", "input", "direct")
MOMENTS = ("mean", "std", "spread", "centre", "reach")


def pack_signature(signature: Signature) -> dict[str, Any]:
    """Moments of a signature as variables of a file."""
    return {
        f"{group}_{name}": (group, getattr(getattr(signature, f"{group}_scale"), name))
        for group in SCALES
        for name in MOMENTS
    }


def signature_json(signature: Signature) -> Json:
    """What a signature holds beside the moments, as JSON values."""
    return {
        "dt": signature.dt,
        "states": [asdict(label) for label in signature.state_labels],
        "inputs": [asdict(label) for label in signature.input_labels],
        "state_delays": signature.state_delays,
        "input_delays": signature.input_delays,
        "input_map": signature.input_map.to_json(),
        "readouts": [each.to_json() for each in signature.readouts],
        "parameter": signature.parameter,
    }


def unpack_signature(dataset: xr.Dataset) -> Signature:
    """Rebuild a signature from :func:`pack_signature` and :func:`signature_json`."""
    values = content(dataset, "signature")
    labels = {
        key: tuple(ChannelLabel(**each) for each in values[key]) for key in ("states", "inputs")
    }
    scales = (Scale(*(numbers(dataset, f"{group}_{each}") for each in MOMENTS)) for group in SCALES)
    state_scale, input_scale, direct_scale = scales
    return Signature(
        dt=values["dt"],
        state_labels=labels["states"],
        input_labels=labels["inputs"],
        state_delays=values["state_delays"],
        input_delays=values["input_delays"],
        input_map=InputMap.from_json(values["input_map"]),
        state_scale=state_scale,
        input_scale=input_scale,
        direct_scale=direct_scale,
        readouts=tuple(FittedReadOut.from_json(each) for each in values["readouts"]),
        parameter=values["parameter"],
    )


def content(dataset: xr.Dataset, name: str) -> Any:
    """JSON value that a file keeps in an attribute."""
    return json.loads(dataset.attrs[name])


def numbers(dataset: xr.Dataset, name: str) -> FloatArray:
    """Array that a file keeps, read-only."""
    values = np.ascontiguousarray(dataset[name].values, dtype=np.float64)
    values.flags.writeable = False
    return values


def as_json(value: object) -> str:
    """Write JSON values as text; numbers of numpy become plain ones."""
    return json.dumps(plain(value))


def read(path: str | Path) -> xr.Dataset:
    """Read a model file into memory, with ``attrs["seakeep_kind"]``; raises as load_sealed."""
    source = Path(path)
    if source.suffix.lower() == ".toml":
        raise RequestError(
            f"{source} is a campaign file, and a model file is expected here. The model comes "
            "first: seakeep compare MODEL.nc CAMPAIGN.toml."
        )
    try:
        return load_sealed(source, MODEL)
    except MissingFileError as error:
        raise MissingFileError(
            f"{error} A model file is expected here: make one with `seakeep fit` or "
            "model.save(...)."
        ) from None
