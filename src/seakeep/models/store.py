"""Models as sealed files: JSON of settings beside arrays, and no code inside."""

import functools
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray, plain
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
            value = table_of(value)
        if isinstance(value, Mapping):
            return {str(key): described(each, f"{path}.{key}") for key, each in value.items()}
        if isinstance(value, list | tuple):
            return [described(each, f"{path}.{number}") for number, each in enumerate(value)]
        return plain(value)

    attrs = {name: json.dumps(described(part, name)) for name, part in parts.items()}
    return xr.Dataset(variables, attrs=attrs)


def table_of(value: Any) -> dict[str, Any]:
    """Fields of a dataclass by name, after its kind if it has one."""
    own = {each.name: getattr(value, each.name) for each in fields(value) if each.init}
    return {"kind": value.kind, **own} if hasattr(value, "kind") else own


def packed(model: Any) -> xr.Dataset:
    """A fitted model as a Dataset: its settings as JSON, and its other fields."""
    own = {each.name: getattr(model, each.name) for each in fields(model)}
    return pack(own | {"settings": model.settings.to_json()})


def restored(kind: Any, dataset: xr.Dataset, **given: Any) -> Any:
    """Rebuild a dataclass of the fields that :func:`pack` wrote, and of those given here."""
    kept = {
        name: _rebuilt(hint, content(dataset, name), dataset)
        for name, hint in _hints(kind).items()
        if name in dataset.attrs and name not in given
    }
    return kind(**kept, **given)


def _rebuilt(kind: Any, value: Any, dataset: xr.Dataset) -> Any:
    origin, inside = get_origin(kind) or kind, get_args(kind)
    if value is None:
        return None
    if origin in (Union, UnionType):
        ways = (_rebuilt(each, value, dataset) for each in inside)
        return next((each for each in ways if each is not value), value)
    if kind == FloatArray:
        numbers = np.ascontiguousarray(dataset[value].values, dtype=np.float64)
        numbers.flags.writeable = False
        return numbers
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
