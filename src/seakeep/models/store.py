"""Models as sealed files: JSON of settings beside arrays, and no code inside."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray, plain
from seakeep.errors import MissingFileError, RequestError
from seakeep.files import load_sealed
from seakeep.models.observables import from_json
from seakeep.models.terms import Observable

MODEL = "model"
"""Kind of these files."""


def pack(parts: Mapping[str, Any]) -> xr.Dataset:
    """Dataclasses as a Dataset: arrays as variables, all else as JSON of an attribute for each."""
    variables: dict[str, Any] = {}

    def described(value: Any, path: str) -> Any:
        if isinstance(value, np.ndarray):
            variables[path] = ([f"{path}_{axis}" for axis in range(value.ndim)], value)
            return path
        if is_dataclass(value):
            own = {each.name: getattr(value, each.name) for each in fields(value) if each.init}
            value = {"kind": value.kind, **own} if hasattr(value, "kind") else own
        if isinstance(value, Mapping):
            return {str(key): described(each, f"{path}.{key}") for key, each in value.items()}
        if isinstance(value, list | tuple):
            return [described(each, f"{path}.{number}") for number, each in enumerate(value)]
        return plain(value)

    attrs = {name: json.dumps(described(part, name)) for name, part in parts.items()}
    return xr.Dataset(variables, attrs=attrs)


def unpack(dataset: xr.Dataset, **kinds: Any) -> dict[str, Any]:
    """Rebuild parts of :func:`pack`, each of its kind: a dataclass, an array, or such and None."""
    return {name: _rebuilt(kind, content(dataset, name), dataset) for name, kind in kinds.items()}


def _rebuilt(kind: Any, value: Any, dataset: xr.Dataset) -> Any:
    origin, inside = get_origin(kind) or kind, get_args(kind)
    if value is None:
        return None
    if origin in (Union, UnionType):
        ways = (_rebuilt(each, value, dataset) for each in inside)
        return next((each for each in ways if each is not value), value)
    if kind == FloatArray:
        return numbers(dataset, value)
    if kind is Observable:
        return from_json(value)
    if origin is tuple:
        kinds = inside[:1] * len(value) if inside[-1] is Ellipsis else inside
        return tuple(_rebuilt(*pair, dataset) for pair in zip(kinds, value, strict=True))
    if isinstance(value, dict):
        is_class = is_dataclass(kind)
        hints = _hints(kind) if is_class else dict.fromkeys(value, inside[-1])
        own = {key: _rebuilt(hints[key], each, dataset) for key, each in value.items()}
        return kind(**own) if is_class else own
    return value


_hints = functools.cache(get_type_hints)


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
            f"{source} is a campaign file, and a model file is expected here: the model comes "
            "first, and then the campaign."
        )
    try:
        return load_sealed(source, MODEL)
    except MissingFileError as error:
        raise MissingFileError(
            f"{error} A model file is expected here: make one with `seakeep fit` or "
            "model.save(...)."
        ) from None
