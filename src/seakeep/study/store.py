"""Results on disk: one file per finished unit, then one NetCDF file for the study."""

from __future__ import annotations

import errno
import hashlib
import io
import json
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import xarray as xr
from filelock import FileLock, Timeout

from seakeep.errors import SHOWN, RequestError, SeakeepError, warn
from seakeep.files import SEAL, check_report, is_there, read_bytes, read_sealed, replacing
from seakeep.study.settings import FORMAT

RESULT = "study.nc"
NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."
HEADER = "study.json"
LOCK = "study.lock"
UNITS = "units"

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
NO_FOLDER = (errno.ENOENT, errno.ENOTDIR, errno.EEXIST, errno.ENAMETOOLONG)

Arrays = dict[str, npt.NDArray[Any]]


class StorageError(SeakeepError):
    """Results could not be written: finished work is kept, and the same command continues."""


def versions() -> dict[str, str]:
    """Versions of what computes the results, by package."""
    return {name: metadata.version(name) for name in ("seakeep", "numpy", "scipy", "xarray")}


@contextmanager
def storing(folder: Path) -> Iterator[None]:
    """Say why results could not be written, and the remedy."""
    try:
        yield
    except (RequestError, OSError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        if not isinstance(cause, OSError):
            raise
        said = f"results could not be written to {folder}: {cause.strerror or cause}."
        if cause.errno in FORBIDDEN:
            raise RequestError(
                f"{said} Choose a folder that you may write to, or change its permissions; the "
                "same command continues with what is there."
            ) from error
        if cause.errno in NO_FOLDER:
            raise RequestError(
                f"{said} No folder can be made or kept there. Choose another place."
            ) from error
        mend = "Free space on the disk" if cause.errno in FULL else "Check the disk"
        raise StorageError(
            f"{said} What was finished is kept. {mend}; the same command then continues where it "
            "stopped."
        ) from error


@dataclass(frozen=True)
class UnitFolder:
    """Finished units of a study, one file each.

    Parameters
    ----------
    folder : Path
        Folder of the results.
    digest : str
        Of the study; a unit of another one is not taken.
    """

    folder: Path
    digest: str

    def check(self) -> None:
        """Refuse, before the work, a folder that cannot be written or holds another study.

        A study that was started and has no finished unit is none: nothing of it is lost.

        Raises
        ------
        RequestError
            If the folder holds the results of another study, or of other versions, or cannot be
            made or written.
        StorageError
            If the disk fails.
        """
        with storing(self.folder):
            (self.folder / UNITS).mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=self.folder / UNITS).close()
        header = self.folder / HEADER
        found = _read_header(header) if header.exists() else None
        is_finished = (self.folder / RESULT).exists()
        if found is not None and (is_finished or any((self.folder / UNITS).glob("*.npz"))):
            _check_header(self.folder, found, self._header())
        elif not is_finished:
            check_report(self.folder)
            if found is None and any((self.folder / UNITS).iterdir()):
                raise RequestError(
                    f"{self.folder / UNITS} holds files, and {header} does not say of which study. "
                    "Choose another folder (-o), or remove this one."
                )

    def open(self, name: str) -> None:
        """Make the folder this study's, or find that it belongs to it; errors as :meth:`check`."""
        self.check()
        text = json.dumps({"study": name, **self._header()}, indent=1)
        with storing(self.folder), replacing(self.folder / HEADER) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other processes out of the folder; the lock ends with this process.

        Raises
        ------
        RequestError
            If another process works there.
        """
        path = self.folder / LOCK
        lock = FileLock(path, timeout=0)
        try:
            lock.acquire()
        except Timeout:
            raise RequestError(
                f"another process works on the study in {self.folder}. Wait until it has finished, "
                "or choose another folder (-o)."
            ) from None
        except (OSError, NotImplementedError):  # without locks in the file system all may work
            yield
            return
        self._clear_litter()
        try:
            yield
        finally:
            with suppress(OSError):  # Windows does not remove a file that is open
                path.unlink()
            lock.release()

    def _clear_litter(self) -> None:
        """Remove files that a killed process had begun; nobody else works in the folder."""
        litter = [each for each in self.folder.rglob(".*.tmp") if each.is_file()]
        for each in litter:
            each.unlink(missing_ok=True)
        if litter:
            warn(f"{self.folder}: removed {len(litter)} unfinished file(s) of a killed run.")

    def _header(self) -> dict[str, Any]:
        return {"digest": self.digest, "versions": versions()}

    def _path(self, name: str) -> Path:
        return self.folder / UNITS / f"{name}.npz"

    def write(self, name: str, arrays: Mapping[str, npt.ArrayLike]) -> None:
        """Keep the arrays of a finished unit; the file is there whole or not at all.

        Raises
        ------
        StorageError
            If the disk is full or cannot be written.
        """
        content = io.BytesIO()
        np.savez(content, digest=np.array(self.digest), **cast("dict[str, Any]", arrays))
        _write_sealed(self._path(name), content.getvalue())

    def read(self, name: str) -> Arrays | None:
        """Arrays of a finished unit; None where it is not finished, or damaged."""
        try:
            content, _, seal = self._path(name).read_bytes().rpartition(SEAL)
        except OSError:
            return None
        if hashlib.sha256(content).hexdigest().encode() != seal:
            return None
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
        return arrays if str(arrays.pop("digest")) == self.digest else None

    def has(self, name: str) -> bool:
        """Whether a unit is finished."""
        return self.read(name) is not None

    def clear(self) -> None:
        """Remove the units; for when all of them are in the result."""
        for path in (self.folder / UNITS).glob("*.npz*"):
            path.unlink(missing_ok=True)
        with suppress(OSError):  # files of others stay
            (self.folder / UNITS).rmdir()


def _write_sealed(path: Path, content: bytes) -> None:
    with storing(path.parent), replacing(path) as temporary:
        temporary.write_bytes(content + SEAL + hashlib.sha256(content).hexdigest().encode())


def _read_header(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(read_bytes(path))
    except (RequestError, ValueError, RecursionError):
        found = None
    if not isinstance(found, dict) or "digest" not in found:
        raise RequestError(
            f"{path} is damaged or belongs to no study. Give another folder with -o, or remove "
            "this one."
        )
    return found


def _check_header(folder: Path, found: Mapping[str, Any], expected: Mapping[str, Any]) -> None:
    if found["digest"] != expected["digest"]:
        raise RequestError(
            f"{folder} holds the results of another study: its digest starts with "
            f"{str(found['digest'])[:12]} and this study's with {expected['digest'][:12]}. "
            "Settings, campaign or raw files have changed since. Give another folder with -o, or "
            "remove this one."
        )
    before, now = found.get("versions", {}), expected["versions"]
    changed = [f"{k} {before.get(k)} (now {v})" for k, v in now.items() if before.get(k) != v]
    if changed:
        raise RequestError(
            f"{folder} was started with {', '.join(changed)}; arrays of both would be mixed. Give "
            "another folder with -o, or remove this one."
        )


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Results of a study, read from its folder by :func:`read_result`.

    Parameters
    ----------
    folder : Path
        The folder.
    attrs : dict
        Settings (JSON), digest, seed, versions, and what figures and tables need to know.
    groups : dict of str to Dataset
        ``channels``, ``training``, ``runs``, ``prepared/RUN``, ``spectra``, ``tests/NAME``,
        ``draws/MODEL``, ``eigenvalues/MODEL``, ``chosen``, ``calibration``, and ``statistics/…``.
    """

    folder: Path
    attrs: dict[str, Any]
    groups: dict[str, xr.Dataset]

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the study as plain data."""
        settings: dict[str, Any] = json.loads(self.attrs["settings"])
        return settings

    @cached_property
    def model_settings(self) -> dict[str, Any]:
        """Per model ``kind``, ``role``, ``preset``, ``ensemble``, ``n_members`` and ``settings``.

        ``settings`` gives for each key its ``value`` (a JSON value) and its ``source``: "stated",
        "preset", "study" (the study's seed) or "default".
        """
        found: dict[str, Any] = json.loads(self.attrs["models"])
        return found

    @property
    def models(self) -> list[str]:
        """Names of the models, in the order of the study file."""
        return list(self.model_settings)

    @property
    def channels(self) -> list[str]:
        """Channels that are forecast."""
        return [str(name) for name in self.groups["channels"]["channel"].values]

    @property
    def tests(self) -> dict[str, xr.Dataset]:
        """Test sets by name."""
        names = self.settings["tests"]
        return {name: self.groups[f"tests/{name}"] for name in names}

    @property
    def prepared(self) -> dict[str, xr.Dataset]:
        """Prepared runs with all of their channels, flags and findings, by name."""
        names = [str(name) for name in self.groups["runs"]["run"].values]
        return {name: self.groups[f"prepared/{name}"] for name in names}

    @property
    def shows_paper(self) -> bool:
        """Whether a report puts the paper's choices and numbers beside those of the study."""
        return bool(self.settings["output"].get("paper", False))

    @property
    def is_calibrated(self) -> bool:
        """Whether bands of ensembles are calibrated."""
        return "calibration" in self.groups

    def is_ensemble(self, model: str) -> bool:
        """Whether a model is an ensemble."""
        return bool(self.model_settings[model]["ensemble"])

    def members_of(self, model: str) -> int:
        """Number of members of a model, 1 of a single one."""
        return int(self.model_settings[model]["n_members"])

    def label_of(self, test: str) -> str:
        """Words for a test set."""
        return str(self.settings["tests"][test]["label"] or test.replace("_", " "))

    def words_of(self, channel: str) -> str:
        """Words for a channel of the study: what the campaign calls it."""
        return str(self.groups["channels"]["long_name"].sel(name=channel).values)


def write_result(
    folder: Path,
    attrs: Mapping[str, Any],
    groups: Mapping[str, xr.Dataset],
    finished: Callable[[StudyResult], None] | None = None,
) -> StudyResult:
    """Write everything into one sealed NetCDF file, renamed into place."""
    created = datetime.now(UTC).isoformat(timespec="seconds")
    found = StudyResult(folder, {"format": FORMAT, "created": created, **attrs}, dict(groups))
    if finished is not None:
        finished(found)
    _write_sealed(folder / RESULT, _content(found))
    return found


def _content(result: StudyResult) -> bytes:
    """NetCDF-4 file of a result; h5netcdf would take a hundred times as long for it."""
    # Here, so that commands that write no result start without HDF5.
    import h5py

    layout = {
        name: [{str(k): each.dims for k, each in part.items()} for part in (group, group.coords)]
        for name, group in result.groups.items()
    }
    made = io.BytesIO()
    with h5py.File(made, "w", libver="latest", track_order=True) as file:
        file.attrs.update(result.attrs | {"layout": json.dumps(layout)})
        for name, group in result.groups.items():
            place = file.create_group(name, track_order=True)
            place.attrs.update(group.attrs)
            for dim in group.sizes:
                if dim not in group.variables:
                    place.create_dataset(dim, (group.sizes[dim],), ">f4").make_scale(NO_VARIABLE)
            for key, each in group.variables.items():
                x, text = each.values, each.dtype.kind in "OU"
                packing: dict[str, Any] = {"dtype": h5py.string_dtype()} if text else {}
                if each.size > 4096 and each.dtype.kind == "f":
                    packing = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
                made_of = {"b": "i1", "U": "O"}.get(each.dtype.kind, each.dtype)
                kept = place.create_dataset(key, data=x.astype(made_of), **packing)
                kept.attrs.update(each.attrs | ({"dtype": "bool"} if x.dtype.kind == "b" else {}))
                if each.dims == (key,):
                    kept.make_scale(key)
            for key, each in group.variables.items():
                for number, dim in enumerate(each.dims if each.dims != (key,) else ()):
                    place[key].dims[number].attach_scale(place[dim])
    return made.getvalue()


def relabel(result: StudyResult, words: Mapping[str, str]) -> StudyResult:
    """Write other names and labels into a finished result: attributes on which no array depends."""
    if all(result.attrs[key] == value for key, value in words.items()):
        return result
    return write_result(result.folder, {**result.attrs, **words}, result.groups)


def read_result(folder: Path | str) -> StudyResult:
    """Read the result of a finished study.

    Parameters
    ----------
    folder : Path or str
        Its folder.

    Returns
    -------
    StudyResult
        In memory.

    Raises
    ------
    RequestError
        If there is no finished study, or one of another format.
    DataError
        If its file is damaged, or was altered since it was written.
    """
    folder = Path(folder)
    path = folder / RESULT
    if not is_there(path):
        started = (folder / HEADER).exists()
        raise RequestError(
            f"{folder} holds no finished study ({RESULT} is missing). "
            + (
                "One was started there: run its 'seakeep study' again to continue."
                if started
                else "Give the folder that 'seakeep study' or 'seakeep reproduce' wrote."
            )
        )
    # Here, so that commands that read no result start without HDF5.
    import h5py

    with h5py.File(read_sealed(path), "r") as file:
        attrs = {key: _plain(value) for key, value in file.attrs.items()}
        if attrs.get("format") != FORMAT:
            raise RequestError(
                f"{path} was written in format {attrs.get('format')!s:.{SHOWN}}, and this version "
                f"of seakeep reads format {FORMAT}. Run the study again in another folder."
            )
        layout = json.loads(attrs.pop("layout"))
        groups = {name: _read_group(file[name], *parts) for name, parts in layout.items()}
    return StudyResult(folder, attrs, groups)


OF_HDF5 = frozenset({"CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST"})
"""Attributes that tie variables to their dimensions."""


def _read_group(place: Any, *parts: Mapping[str, Sequence[str]]) -> xr.Dataset:
    read: list[dict[str, xr.Variable]] = [{}, {}]
    for into, part in zip(read, parts, strict=True):
        for key, dims in part.items():
            attrs = {k: _plain(v) for k, v in place[key].attrs.items() if k not in OF_HDF5}
            values = (place[key].asstr() if place[key].dtype.kind == "O" else place[key])[()]
            into[key] = xr.Variable(dims, np.asarray(values, attrs.pop("dtype", None)), attrs)
    variables, coords = read
    return xr.Dataset(variables, coords, {k: _plain(v) for k, v in place.attrs.items()})


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value
