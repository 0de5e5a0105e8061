"""The file of an ensemble: draws and training arrays, versioned, no code inside."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import xarray as xr

from seakeep.errors import SeakeepWarning
from seakeep.models.alignment import FittedAlignment
from seakeep.models.draws import Draw
from seakeep.models.labelled import ChannelLabel
from seakeep.models.members import TrainingArrays
from seakeep.models.settings import HankelSettings
from seakeep.models.store import as_json

__all__ = ["BAYESIAN_HANKEL_DMDC", "draws_dataset", "pack", "unpack"]

BAYESIAN_HANKEL_DMDC = "bayesian_hankel_dmdc"

DRAWN = {
    "train_length": ("length of the training window", "encounter periods"),
    "state_delay": ("longest delay of the states", "encounter periods"),
    "input_delay": ("longest delay of the inputs", "encounter periods"),
    "ridge": ("ridge λ", "1"),
}
ROUNDED = {
    "train_length_samples": ("window", "length of the training window; −1 for all of a run"),
    "state_delay_samples": ("state_delays", "number of delayed copies of the states"),
    "input_delay_samples": ("input_delays", "number of delayed copies of the inputs"),
    "training_run": ("run", "run that trains; −1 for all"),
    "last_sample": ("last", "last sample of the training window; −1 for that at stop"),
    "redrawn": ("redrawn", "infeasible draws before this one"),
}
OPTIONAL = ("window", "run", "last")


@dataclass(frozen=True, eq=False)
class Parts:
    """What :func:`unpack` finds in a file."""

    settings: HankelSettings
    origin: dict[str, Any]
    members: tuple[Draw, ...]
    arrays: TrainingArrays
    dt: float
    labels: dict[str, tuple[ChannelLabel, ...]]
    alignment: FittedAlignment | None
    radii: np.ndarray[Any, np.dtype[np.float64]] | None


def draws_dataset(members: Sequence[Draw], origin: Mapping[str, Any]) -> xr.Dataset:
    """Draws over ``member``; see ``HankelEnsemble.draws``."""
    variables = {
        name: (
            "member",
            np.array([getattr(draw, name) for draw in members], dtype=float),
            {"long_name": label, "units": units},
        )
        for name, (label, units) in DRAWN.items()
    }
    for name, (attribute, label) in ROUNDED.items():
        values = [getattr(draw, attribute) for draw in members]
        integers = np.array([-1 if value is None else value for value in values], dtype=np.int64)
        variables[name] = ("member", integers, {"long_name": label, "units": "1"})
    attrs = {
        "ensemble": json.dumps(dict(origin)),
        "redrawn": sum(draw.redrawn for draw in members),
    }
    return xr.Dataset(variables, coords={"member": np.arange(len(members))}, attrs=attrs)


def pack(
    *,
    settings: HankelSettings,
    origin: Mapping[str, Any],
    members: Sequence[Draw],
    arrays: TrainingArrays,
    dt: float,
    labels: Mapping[str, tuple[ChannelLabel, ...]],
    alignment: FittedAlignment | None = None,
    radii: np.ndarray[Any, np.dtype[np.float64]] | None = None,
) -> xr.Dataset:
    """Put the parts of an ensemble into a Dataset of arrays and JSON texts."""
    dataset = draws_dataset(members, origin)
    variables: dict[str, Any] = {}
    if radii is not None:
        label = {"long_name": "spectral radius", "units": "1"}
        variables["spectral_radius"] = ("member", radii, label)
    for number, (x, u) in enumerate(zip(arrays.states, arrays.inputs, strict=True)):
        variables[f"states_{number}"] = ((f"sample_{number}", "state"), x)
        variables[f"inputs_{number}"] = ((f"sample_{number}", "input"), u)
    place = {
        "names": arrays.names,
        "offsets": [int(offset) for offset in arrays.offsets],
        "begins": arrays.begins,
    }
    return dataset.assign(variables).assign_attrs(
        dt=dt,
        settings=as_json(settings),
        runs=json.dumps(place),
        alignment="null" if alignment is None else as_json(alignment),
        labels=json.dumps({k: [asdict(label) for label in v] for k, v in labels.items()}),
    )


def unpack(dataset: xr.Dataset) -> Parts:
    """Take the parts of an ensemble out of a Dataset; the inverse of :func:`pack`."""
    labels = {
        group: tuple(ChannelLabel(**label) for label in entries)
        for group, entries in json.loads(dataset.attrs["labels"]).items()
    }
    place = json.loads(dataset.attrs["runs"])
    alignment = json.loads(dataset.attrs.get("alignment", "null"))
    count = range(len(place["names"]))
    arrays = TrainingArrays(
        names=tuple(place["names"]),
        states=tuple(_values(dataset, f"states_{number}") for number in count),
        inputs=tuple(_values(dataset, f"inputs_{number}") for number in count),
        offsets=tuple(place["offsets"]),
        begins=tuple(place["begins"]),
        state_names=tuple(label.name for label in labels["state"]),
        input_names=tuple(label.name for label in labels["input"]),
    )
    for x, u in zip(arrays.states, arrays.inputs, strict=True):
        if (x.shape[1], u.shape[1]) != (len(labels["state"]), len(labels["input"])):
            raise ValueError(
                f"training arrays have {x.shape[1]} states and {u.shape[1]} inputs, not "
                f"{len(labels['state'])} and {len(labels['input'])}"
            )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SeakeepWarning)  # given when the ensemble was made
        settings = HankelSettings(**json.loads(dataset.attrs["settings"]))
    return Parts(
        settings=settings,
        origin=json.loads(dataset.attrs["ensemble"]),
        members=tuple(_draw(dataset, member) for member in range(dataset.sizes["member"])),
        arrays=arrays,
        dt=float(dataset.attrs["dt"]),
        labels=labels,
        alignment=FittedAlignment.from_dict(alignment) if alignment else None,
        radii=_values(dataset, "spectral_radius") if "spectral_radius" in dataset else None,
    )


def _draw(dataset: xr.Dataset, member: int) -> Draw:
    fields: dict[str, Any] = {name: float(dataset[name].values[member]) for name in DRAWN}
    for name, (attribute, _) in ROUNDED.items():
        value = int(dataset[name].values[member])
        fields[attribute] = None if value < 0 and attribute in OPTIONAL else value
    return Draw(**fields)


def _values(dataset: xr.Dataset, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    values = np.ascontiguousarray(dataset[name].values, dtype=np.float64)
    values.flags.writeable = False
    return values
