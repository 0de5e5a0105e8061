"""Files of models: NetCDF, versioned, written to a temporary name, no code inside."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np
import xarray as xr

from seakeep.arrays import GREATEST, FloatArray
from seakeep.errors import DataError, MissingFileError, RequestError
from seakeep.files import MARK, check_output, read_sealed, replacing, write_netcdf
from seakeep.models.inputs import Chain
from seakeep.models.interface import Json, Scale, Signature
from seakeep.models.labelled import ChannelLabel
from seakeep.models.readouts import FittedReadOut

__all__ = [
    "FORMAT_VERSION",
    "Saved",
    "as_json",
    "content",
    "labels",
    "numbers",
    "pack_signature",
    "read",
    "rebuilt",
    "signature_json",
    "unpack_signature",
    "write",
]

FORMAT_VERSION = 3
"""Version of the layout. Files of another one are refused: models are quickly fitted again."""
SCALES = ("state", "input", "direct")
MOMENTS = ("mean", "std", "spread", "centre", "reach")

Value = TypeVar("Value")


class Saved:
    """A model that a NetCDF file can hold; it has a ``kind`` and ``to_dataset``."""

    kind: ClassVar[str]

    def to_dataset(self) -> xr.Dataset:
        """All that :meth:`save` writes."""
        raise NotImplementedError

    def save(self, path: str | Path) -> Path:
        """Write the model as NetCDF, to a temporary name first.

        Parameters
        ----------
        path : str or Path
            File; another model there is replaced.

        Returns
        -------
        Path
            The file; :func:`seakeep.load_model` reads it, running no code from it.

        Raises
        ------
        RequestError
            If the file cannot be written, or another one than a model is there.
        """
        return write(self.to_dataset(), path, self.kind)


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
        "dt": float(signature.dt),
        "states": [asdict(label) for label in signature.state_labels],
        "inputs": [asdict(label) for label in signature.input_labels],
        "state_delays": int(signature.state_delays),
        "input_delays": int(signature.input_delays),
        "input_map": signature.input_map.to_json(),
        "readouts": [each.to_json() for each in signature.readouts],
    }


def unpack_signature(dataset: xr.Dataset) -> Signature:
    """Rebuild a signature; a file whose parts do not fit together raises a ValueError."""
    kept = content(dataset, "signature")
    state_labels, input_labels = labels(dataset, "states"), labels(dataset, "inputs")
    input_map = Chain.from_json(kept["input_map"])
    dt = float(kept["dt"])
    delays = {key: kept[key] for key in ("state_delays", "input_delays")}
    for key, value in delays.items():
        if type(value) is not int or value < 0:
            raise ValueError(f"{key} is {value!r}, not a number of samples")
    if not 1e-9 < dt < 1e9 or not state_labels:
        raise ValueError(f"dt is {dt!r} and there are {len(state_labels)} states")
    delayed, direct = input_map.regressors(input_labels)
    sizes = {"state": len(state_labels), "input": len(delayed), "direct": len(direct)}
    scales = {
        group: Scale(*(numbers(dataset, f"{group}_{name}", (size,)) for name in MOMENTS))
        for group, size in sizes.items()
    }
    for group, scale in scales.items():
        if np.any(scale.std <= 0) or np.any(scale.spread < 0) or np.any(scale.reach < 0):
            raise ValueError(f"a standard deviation or a reach of {group} channels is negative")
    names = [label.name for label in state_labels]
    return Signature(
        dt=dt,
        state_labels=state_labels,
        input_labels=input_labels,
        **delays,
        input_map=input_map,
        state_scale=scales["state"],
        input_scale=scales["input"],
        direct_scale=scales["direct"],
        readouts=tuple(FittedReadOut.from_json(each, names) for each in kept["readouts"]),
    )


def labels(dataset: xr.Dataset, group: str) -> tuple[ChannelLabel, ...]:
    """Labels of the states or inputs that a file names."""
    return tuple(
        ChannelLabel(*(str(each[key]) for key in ("name", "units", "long_name")))
        for each in content(dataset, "signature")[group]
    )


def content(dataset: xr.Dataset, name: str) -> Json:
    """JSON table that a file keeps in an attribute."""
    found = json.loads(dataset.attrs[name], parse_constant=_constant, parse_float=_bounded)
    if not isinstance(found, dict):
        raise ValueError(f"{name} is no table")
    return found


def _constant(text: str) -> float:
    if text == "NaN":
        raise ValueError("a number is NaN")
    return float(text)


def _bounded(text: str) -> float:
    if abs(value := float(text)) > GREATEST:
        raise ValueError(f"a number is {text}, which nothing measures")
    return value


def numbers(dataset: xr.Dataset, name: str, shape: Sequence[int | None]) -> FloatArray:
    """Array of finite numbers of a shape; None stands for any length."""
    values = np.ascontiguousarray(dataset[name].values, dtype=np.float64)
    fits = values.ndim == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, values.shape, strict=True)
    )
    if not fits:
        expected = tuple("any" if each is None else each for each in shape)
        raise ValueError(f"{name} has shape {values.shape}, not {expected}")
    if not np.all(np.abs(values) <= GREATEST):
        raise ValueError(f"{name} holds values that are not finite, or beyond {GREATEST:g}")
    values.flags.writeable = False
    return values


def as_json(value: object) -> str:
    """Write JSON values as text; numbers of numpy become plain ones."""
    return json.dumps(value, default=_plain)


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(type(value).__name__)


def rebuilt(source: str | Path, build: Callable[[], Value]) -> Value:
    """What `build` makes of a file's content; anything that does not fit raises one DataError."""
    try:
        return build()
    except DataError:
        raise
    except (
        LookupError,
        TypeError,
        ValueError,
        ArithmeticError,
        AttributeError,
        RecursionError,
    ) as error:
        missing = "a part is missing: " if isinstance(error, LookupError) else ""
        raise DataError(
            f"{source} is incomplete: {missing}{error}. Fit the model again."
        ) from error


def write(dataset: xr.Dataset, path: str | Path, kind: str, what: str = "model") -> Path:
    """Write a Dataset as a model file.

    Parameters
    ----------
    dataset : Dataset
        What a model's ``to_dataset`` gives.
    path : str or Path
        File; an earlier model there is replaced.
    kind : str
        Kind of model.
    what : str, optional
        What the file holds, as its head states it.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RequestError
        If the file cannot be written, or another one than a model is there.
    """
    target = Path(path)
    check_output(target, what)
    labelled = dataset.assign_attrs(
        **{MARK: what},
        seakeep_kind=kind,
        seakeep_format=FORMAT_VERSION,
        seakeep_version=metadata.version("seakeep"),
    )
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
    if source.suffix.lower() == ".toml":
        raise RequestError(
            f"{source} is a campaign file, and a model file is expected here. The model comes "
            "first: seakeep compare MODEL.nc CAMPAIGN.toml."
        )
    try:
        content = read_sealed(source)
    except MissingFileError as error:
        raise MissingFileError(
            f"{error} A model file is expected here: make one with `seakeep fit` or "
            "model.save(...)."
        ) from None
    dataset = xr.load_dataset(content, engine="h5netcdf")
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
            f"{source} states the layout {dataset.attrs['seakeep_format']!r}, which is not a "
            "number: the file was altered. Save the model again."
        ) from None
    if version > FORMAT_VERSION:
        raise DataError(
            f"{source} has layout {version}, written by seakeep "
            f"{dataset.attrs.get('seakeep_version', '?')}; this seakeep "
            f"({metadata.version('seakeep')}) reads layout {FORMAT_VERSION}. Update seakeep, or "
            "fit the model again with this version."
        )
    if version < FORMAT_VERSION:
        raise DataError(
            f"{source} has the old layout {version}, which is no longer read. Fit the model again."
        )
    return dataset
