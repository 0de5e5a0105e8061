"""Files of models: NetCDF, versioned, written to a temporary name, no code inside."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.errors import DataError, RequestError
from seakeep.files import MARK, replacing, write_netcdf
from seakeep.models.identification import Scale
from seakeep.models.labelled import ChannelLabel

__all__ = [
    "FORMAT_VERSION",
    "HANKEL_DMDC",
    "as_json",
    "checksum",
    "pack",
    "read",
    "unpack",
    "write",
]

FloatArray = npt.NDArray[np.float64]

HANKEL_DMDC = "hankel_dmdc"
FORMAT_VERSION = 2
"""Version of the layout; raised when an older seakeep could not read a new file rightly. From 2 on
files carry a checksum."""


@dataclass(frozen=True, eq=False)
class Parts:
    """What :func:`unpack` finds in a file."""

    settings: dict[str, Any]
    training: dict[str, Any]
    labels: dict[str, tuple[ChannelLabel, ...]]
    scales: dict[str, Scale]
    dt: float
    coefficients: FloatArray
    alignment: dict[str, Any] | None


def pack(
    *,
    settings: object,
    training: object,
    labels: Mapping[str, tuple[ChannelLabel, ...]],
    scales: Mapping[str, Scale],
    dt: float,
    coefficients: FloatArray,
    alignment: object | None = None,
) -> xr.Dataset:
    """Put the parts of a model into a Dataset of arrays and JSON texts."""
    variables: dict[str, Any] = {
        "coefficients": (
            ("row", "regressor"),
            coefficients,
            {"long_name": "regressed rows of [A B] on standardised deviations", "units": "1"},
        )
    }
    for group, scale in scales.items():
        for name in ("mean", "std", "spread"):
            variables[f"{group}_{name}"] = (group, getattr(scale, name))
    attrs = {
        "dt": dt,
        "settings": as_json(settings),
        "training": as_json(training),
        "labels": json.dumps({k: [asdict(label) for label in v] for k, v in labels.items()}),
    }
    if alignment is not None:
        attrs["alignment"] = as_json(alignment)
    return xr.Dataset(variables, attrs=attrs)


def unpack(dataset: xr.Dataset) -> Parts:
    """Take the parts of a model out of a Dataset; the inverse of :func:`pack`."""
    labels = {
        group: tuple(ChannelLabel(**label) for label in entries)
        for group, entries in json.loads(dataset.attrs["labels"]).items()
    }
    scales = {
        group: Scale(*(_values(dataset, f"{group}_{name}") for name in ("mean", "std", "spread")))
        for group in labels
    }
    training = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in json.loads(dataset.attrs["training"]).items()
    }
    settings = json.loads(dataset.attrs["settings"])
    return Parts(
        settings=settings,
        training=training,
        labels=labels,
        scales=scales,
        dt=float(dataset.attrs["dt"]),
        coefficients=_values(dataset, "coefficients"),
        alignment=json.loads(dataset.attrs.get("alignment", "null")),
    )


def _values(dataset: xr.Dataset, name: str) -> FloatArray:
    return np.ascontiguousarray(dataset[name].values, dtype=float)


def as_json(value: object) -> str:
    """Write a dataclass as JSON; numbers of numpy become plain ones."""
    assert is_dataclass(value)
    assert not isinstance(value, type)
    return json.dumps(asdict(value), default=_plain)


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(type(value).__name__)


def write(dataset: xr.Dataset, path: str | Path, kind: str) -> Path:
    """Write a Dataset as a model file.

    Parameters
    ----------
    dataset : Dataset
        From :func:`pack`.
    path : str or Path
        File, overwritten if it exists.
    kind : str
        Kind of model.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RequestError
        If the file cannot be written.
    """
    target = Path(path)
    labelled = dataset.assign_attrs(
        **{MARK: "model"},
        seakeep_kind=kind,
        seakeep_format=FORMAT_VERSION,
        seakeep_version=metadata.version("seakeep"),
    )
    labelled.attrs["checksum"] = checksum(labelled)
    with replacing(target) as temporary:
        write_netcdf(temporary, labelled)
    return target


def read(path: str | Path) -> xr.Dataset:
    """Read a model file into memory and check what it is.

    Parameters
    ----------
    path : str or Path
        File.

    Returns
    -------
    Dataset
        With ``attrs["seakeep_kind"]``.

    Raises
    ------
    RequestError
        If the file does not exist.
    DataError
        If it is damaged, not a model, or of a newer layout.
    """
    source = Path(path)
    if source.is_dir():
        raise RequestError(f"{source} is a folder. Name the model file in it.")
    if source.suffix.lower() == ".toml":
        raise RequestError(
            f"{source} is a campaign file, and a model file is expected here. The model comes "
            "first: seakeep compare MODEL.nc CAMPAIGN.toml."
        )
    if not source.is_file():
        raise RequestError(
            f"there is no model file {source}. Make one with `seakeep fit` or model.save(...)."
        )
    try:
        dataset = xr.load_dataset(source, engine="h5netcdf")
    except Exception as error:
        raise DataError(
            f"{source} cannot be read as NetCDF ({source.stat().st_size} bytes): it is truncated, "
            "damaged or of another format. Copy it again, or save the model again."
        ) from error
    if "seakeep_kind" not in dataset.attrs:
        raise DataError(
            f"{source} is a NetCDF file and not a seakeep model (variables: "
            f"{', '.join(map(str, dataset.variables)) or 'none'}). Name a file written by "
            "model.save or `seakeep fit`."
        )
    try:
        version = int(dataset.attrs.get("seakeep_format", 0))
    except (TypeError, ValueError):
        raise DataError(
            f"{source} states the layout {dataset.attrs['seakeep_format']!r}, which is no number: "
            "the file was altered. Save the model again."
        ) from None
    if version > FORMAT_VERSION:
        raise DataError(
            f"{source} has layout {version}, written by seakeep "
            f"{dataset.attrs.get('seakeep_version', '?')}; this seakeep "
            f"({metadata.version('seakeep')}) reads up to {FORMAT_VERSION}. Update seakeep, or "
            "save the model again with this version."
        )
    if version < 1 or (version > 1 and dataset.attrs.get("checksum") != checksum(dataset)):
        raise DataError(
            f"{source} does not hold what was written into it (its checksum differs): it was "
            "damaged or altered. Copy it again, or save the model again."
        )
    return dataset


def checksum(dataset: xr.Dataset) -> str:
    """SHA-256 over all that a model file holds, the checksum itself aside.

    Parameters
    ----------
    dataset : Dataset
        What is written, or was read.

    Returns
    -------
    str
        Hexadecimal digits.
    """
    found = hashlib.sha256()
    told = {key: value for key, value in dataset.attrs.items() if key != "checksum"}
    found.update(json.dumps(told, default=_plain, sort_keys=True).encode())
    for name in sorted(map(str, dataset.variables)):
        variable = dataset.variables[name]
        kind = [name, variable.dims, variable.shape, variable.dtype.str, variable.attrs]
        found.update(json.dumps(kind, default=_plain, sort_keys=True).encode())
        found.update(np.ascontiguousarray(variable.values).tobytes())
    return found.hexdigest()
