"""Files of models: NetCDF, versioned, written to a temporary name, no code inside."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
import xarray as xr

from seakeep.arrays import GREATEST, LONGEST_STEP, SHORTEST_STEP, FloatArray
from seakeep.errors import DataError, MissingFileError, RequestError
from seakeep.files import MARK, check_output, read_sealed, replacing, write_netcdf
from seakeep.models.checks import parsed, typed
from seakeep.models.inputs import Chain
from seakeep.models.interface import Json, Scale, Signature
from seakeep.models.labelled import ChannelLabel
from seakeep.models.readouts import FittedReadOut

if TYPE_CHECKING:
    from seakeep.models.settings import HankelSettings

__all__ = [
    "FORMAT_VERSION",
    "Saved",
    "as_json",
    "check_settings",
    "content",
    "document",
    "numbers",
    "pack_signature",
    "read",
    "rebuilt",
    "signature_json",
    "unpack_signature",
    "write",
]

FORMAT_VERSION = 4
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
    kept = typed(_Signature, content(dataset, "signature"), "signature")
    input_map = Chain.from_json(kept.input_map)
    for key in ("state_delays", "input_delays"):
        if (value := getattr(kept, key)) < 0:
            raise ValueError(f"{key} is {value!r}, not a number of samples")
    if not SHORTEST_STEP < kept.dt < LONGEST_STEP or not kept.states:
        raise ValueError(f"dt is {kept.dt!r} and there are {len(kept.states)} states")
    delayed, direct = input_map.regressors(kept.inputs)
    sizes = {"state": len(kept.states), "input": len(delayed), "direct": len(direct)}
    scales = {
        group: Scale(*(numbers(dataset, f"{group}_{name}", (size,)) for name in MOMENTS))
        for group, size in sizes.items()
    }
    for group, scale in scales.items():
        if np.any(scale.std < 1 / GREATEST) or np.any(scale.spread < 0) or np.any(scale.reach < 0):
            raise ValueError(f"a standard deviation or a reach of {group} channels is negative")
    if np.any(scales["state"].spread < 1 / GREATEST):
        raise ValueError("state_spread of a state is zero: it was constant in training")
    names = [label.name for label in kept.states]
    inputs = [label.name for label in kept.inputs]
    for named in (names, inputs):
        if twice := [each for each in named if named.count(each) > 1]:
            raise ValueError(f"signature names the channel {twice[0]} more than once")
    aligned = input_map.alignment
    if aligned is not None and (list(aligned.inputs), list(aligned.states)) != (inputs, names):
        raise ValueError(
            f"input_map aligns {', '.join((*aligned.inputs, *aligned.states))}, and the model has "
            f"{', '.join((*inputs, *names))}"
        )
    return Signature(
        dt=kept.dt,
        state_labels=kept.states,
        input_labels=kept.inputs,
        state_delays=kept.state_delays,
        input_delays=kept.input_delays,
        input_map=input_map,
        state_scale=scales["state"],
        input_scale=scales["input"],
        direct_scale=scales["direct"],
        readouts=tuple(FittedReadOut.from_json(each, names) for each in kept.readouts),
    )


def check_settings(settings: HankelSettings, signature: Signature, delays: bool = True) -> None:
    """Refuse settings of a file that its matrices or input map contradict: a ValueError."""
    chain = Chain.of(signature.input_map)
    maps: dict[str, Any] = {each.kind: each for each in chain.maps}
    lead, aligned, observed = maps.get("lead"), chain.alignment, chain.observed
    stated = {"lead": int(settings.lead), "observables": settings.observables}
    fitted = {
        "lead": 0 if lead is None else lead.samples,
        "observables": () if observed is None else observed.observables,
    }
    if (following := maps.get("following")) is not None:
        fitted["lead"] = following.ahead
    if aligned is not None:  # an optional one may be left out
        stated["alignment"] = settings.alignment and replace(settings.alignment, surge="none")
        fitted["alignment"] = replace(aligned.settings, surge="none")
    if settings.readouts != "auto":
        stated["readouts"] = [each.channel for each in settings.readouts]
        fitted["readouts"] = [each.channel for each in signature.readouts]
    if delays:
        for key in ("state_delays", "input_delays"):
            stated[key], fitted[key] = getattr(settings, key), getattr(signature, key)
    for key, value in fitted.items():
        if stated[key] != value:
            raise ValueError(
                f"{key} is {stated[key]} in its settings, and it was fitted with {value}"
            )


@dataclass(frozen=True)
class _Signature:
    """What the attribute ``signature`` of a file holds."""

    dt: float
    states: tuple[ChannelLabel, ...]
    inputs: tuple[ChannelLabel, ...]
    state_delays: int
    input_delays: int
    input_map: Json
    readouts: list[Json]


def content(dataset: xr.Dataset, name: str) -> Json:
    """JSON table that a file keeps in an attribute."""
    found = document(dataset, name)
    if not isinstance(found, dict):
        raise ValueError(f"{name} is no table")
    return found


def document(dataset: xr.Dataset, name: str) -> Any:
    """JSON value that a file keeps in an attribute."""
    return parsed(str(dataset.attrs[name]), name)


def numbers(dataset: xr.Dataset, name: str, shape: Sequence[int | None]) -> FloatArray:
    """Array of finite numbers of a shape; None stands for any length."""
    found = dataset[name].values
    if found.dtype.kind not in "fiub":
        raise ValueError(f"{name} holds {found.dtype}, not numbers")
    values = np.ascontiguousarray(found, dtype=np.float64)
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


def rebuilt(
    source: str | Path, build: Callable[[], Value], mend: str = "Fit the model again."
) -> Value:
    """What `build` makes of a file's content; anything that does not fit raises one DataError."""
    try:
        return build()
    except DataError as error:
        raise DataError(f"{source}: {error}") from error
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
            f"{source} does not hold what seakeep writes: {missing}{str(error).rstrip('.')}. {mend}"
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
