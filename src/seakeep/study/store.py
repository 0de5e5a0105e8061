"""Results on disk: one file a finished cell, then one NetCDF file with everything."""

from __future__ import annotations

import errno
import json
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.errors import DataError, RequestError, SeakeepError
from seakeep.files import replacing, write_netcdf
from seakeep.interruption import uninterrupted

__all__ = [
    "RESULT",
    "CellFolder",
    "StorageError",
    "StudyResult",
    "read_result",
    "retell",
    "versions",
    "write_result",
]

FORMAT = 3
"""Goes into digest and result: raise it when the same settings begin to give other arrays."""

RESULT = "study.nc"
HEADER = "study.json"
CELLS = "cells"

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
NO_FOLDER = (errno.ENOENT, errno.ENOTDIR, errno.EEXIST, errno.ENAMETOOLONG)

Arrays = dict[str, npt.NDArray[Any]]


class StorageError(SeakeepError):
    """Results could not be written: what is finished is kept, and the same command goes on."""


def versions() -> dict[str, str]:
    """Versions of what computes the results, by package."""
    return {name: metadata.version(name) for name in ("seakeep", "numpy", "scipy", "xarray")}


@contextmanager
def storing(folder: Path) -> Iterator[None]:
    """Tell why results could not be written, and what mends it.

    Parameters
    ----------
    folder : Path
        Folder of the results.

    Raises
    ------
    RequestError
        If there can be no such folder, or it may not be written to.
    StorageError
        If the disk is full or fails.
    """
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
                "same command goes on with the cells that are there."
            ) from error
        if cause.errno in NO_FOLDER:
            raise RequestError(
                f"{said} No folder can be made or kept there. Choose another place."
            ) from error
        mend = "Free space on the disk" if cause.errno in FULL else "Look after the disk"
        raise StorageError(
            f"{said} All cells that were finished are kept. {mend}; the same command then goes on "
            "where it stopped."
        ) from error


@dataclass(frozen=True)
class CellFolder:
    """Finished cells of a study, one file each.

    Parameters
    ----------
    folder : Path
        Folder of the results.
    digest : str
        Of the study; a cell of another one is not taken.
    """

    folder: Path
    digest: str

    def check(self) -> None:
        """Find, before the work, that the folder can be written and holds no other study.

        A study that was begun and has no finished cell is none: nothing of it is lost.

        Raises
        ------
        RequestError
            If the folder holds the results of another study, or of other versions, or cannot be
            made or written.
        StorageError
            If the disk fails.
        """
        with storing(self.folder):
            (self.folder / CELLS).mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=self.folder / CELLS).close()
        header = self.folder / HEADER
        if header.exists() and self._holds_results():
            _check_header(self.folder, _read_header(header), self._header())

    def open(self, name: str) -> None:
        """Make the folder this study's, or find that it belongs to it.

        Parameters
        ----------
        name : str
            Name of the study, for people who look into the folder.

        Raises
        ------
        RequestError
            As :meth:`check`.
        StorageError
            If the disk is full or fails.
        """
        self.check()
        text = json.dumps({"study": name, **self._header()}, indent=1)
        with storing(self.folder), replacing(self.folder / HEADER) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

    def _header(self) -> dict[str, Any]:
        return {"digest": self.digest, "versions": versions()}

    def _holds_results(self) -> bool:
        return (self.folder / RESULT).exists() or any((self.folder / CELLS).glob("*.npz"))

    def _path(self, name: str) -> Path:
        return self.folder / CELLS / f"{name}.npz"

    def write(self, name: str, arrays: Mapping[str, npt.ArrayLike]) -> None:
        """Keep a finished cell; it is there whole or not at all.

        Parameters
        ----------
        name : str
            Name of the cell.
        arrays : mapping of str to array_like
            What it found.

        Raises
        ------
        StorageError
            If the disk is full or cannot be written.
        """
        kept: dict[str, Any] = {key: np.asarray(value) for key, value in arrays.items()}
        with (
            uninterrupted(),
            storing(self.folder),
            replacing(self._path(name)) as temporary,
            temporary.open("wb") as file,
        ):
            np.savez(file, digest=np.array(self.digest), **kept)

    def read(self, name: str) -> Arrays | None:
        """Arrays of a finished cell.

        Parameters
        ----------
        name : str
            Name of the cell.

        Returns
        -------
        dict of str to ndarray, or None
            None where it is not finished, or damaged.
        """
        try:
            # numpy leaves a damaged file open that it opened itself
            with (
                uninterrupted(),
                self._path(name).open("rb") as opened,
                np.load(opened, allow_pickle=False) as file,
            ):
                arrays = {key: file[key] for key in file.files}
        except (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile):
            return None
        return arrays if str(arrays.pop("digest", "")) == self.digest else None

    def has(self, name: str) -> bool:
        """Whether a cell is finished."""
        return self._path(name).exists() and self.read(name) is not None

    def clear(self) -> None:
        """Remove the cells; for when all of them are in the result."""
        for path in (self.folder / CELLS).glob("*.npz*"):
            path.unlink(missing_ok=True)
        with suppress(OSError):  # somebody else's files stay
            (self.folder / CELLS).rmdir()


def _read_header(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        found = None
    if not isinstance(found, dict) or "digest" not in found:
        raise RequestError(
            f"{path} is damaged or no study's. Give another folder with -o, or remove this one."
        )
    return found


def _check_header(folder: Path, found: Mapping[str, Any], expected: Mapping[str, Any]) -> None:
    if found["digest"] != expected["digest"]:
        raise RequestError(
            f"{folder} holds the results of another study: its digest begins with "
            f"{str(found['digest'])[:12]} and this study's with {expected['digest'][:12]}. "
            "Settings, campaign or raw files have changed since. Give another folder with -o, or "
            "remove this one."
        )
    before, now = found.get("versions", {}), expected["versions"]
    changed = [f"{k} {before.get(k)} (now {v})" for k, v in now.items() if before.get(k) != v]
    if changed:
        raise RequestError(
            f"{folder} was begun with {', '.join(changed)}; arrays of both would be mixed. Give "
            "another folder with -o, or remove this one."
        )


@dataclass(frozen=True, eq=False)
class StudyResult:
    """All that a study found; read from its folder by :func:`read_result`.

    Parameters
    ----------
    folder : Path
        The folder.
    attrs : dict
        Settings (JSON), digest, seed, versions, and what figures and tables need to know.
    groups : dict of str to Dataset
        ``channels``, ``training``, ``runs``, ``prepared/RUN``, ``spectra``, ``tests/NAME``,
        ``draws/MODEL``, ``calibration/MODEL``, ``eigenvalues/MODEL``, and ``statistics/…``.
    """

    folder: Path
    attrs: dict[str, Any]
    groups: dict[str, xr.Dataset]

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the study as plain data."""
        settings: dict[str, Any] = json.loads(self.attrs["settings"])
        return settings

    @property
    def models(self) -> list[str]:
        """Names of the models, in the order of the study file."""
        return list(self.settings["models"])

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
        return any(name.startswith("calibration/") for name in self.groups)

    def is_ensemble(self, model: str) -> bool:
        """Whether a model is an ensemble."""
        return str(self.settings["models"][model]["kind"]).startswith("bayesian")

    def label_of(self, test: str) -> str:
        """Words for a test set."""
        return str(self.settings["tests"][test]["label"] or test.replace("_", " "))

    def words_of(self, channel: str) -> str:
        """Words for a channel of the study: what the campaign calls it."""
        return str(self.groups["channels"]["long_name"].sel(name=channel).values)


def write_result(
    folder: Path, attrs: Mapping[str, Any], groups: Mapping[str, xr.Dataset]
) -> StudyResult:
    """Write everything into one NetCDF file, renamed into place.

    Parameters
    ----------
    folder : Path
        Folder of the results.
    attrs : mapping
        Attributes of the whole.
    groups : mapping of str to Dataset
        Group by name.

    Returns
    -------
    StudyResult
        The same.

    Raises
    ------
    StorageError
        If the file cannot be written.
    """
    kept = {**attrs, "format": FORMAT, "created": datetime.now(UTC).isoformat(timespec="seconds")}
    with uninterrupted(), storing(folder), replacing(folder / RESULT) as temporary:
        write_netcdf(temporary, xr.Dataset(attrs=kept), groups, _packing)
    return StudyResult(folder, kept, dict(groups))


def _packing(group: xr.Dataset) -> dict[str, dict[str, object]]:
    return {
        str(key): {"zlib": True, "complevel": 1, "shuffle": True}
        for key, variable in group.data_vars.items()
        if variable.size > 4096 and variable.dtype.kind == "f"
    }


def retell(result: StudyResult, words: Mapping[str, str]) -> StudyResult:
    """Write other words into a finished result: attributes on which no array depends.

    Parameters
    ----------
    result : StudyResult
        The result.
    words : mapping of str to str
        Attributes.

    Returns
    -------
    StudyResult
        With these words.

    Raises
    ------
    StorageError
        If the file cannot be written.
    """
    changed = {key: value for key, value in words.items() if result.attrs.get(key) != value}
    if not changed:
        return result
    path = result.folder / RESULT
    with uninterrupted(), storing(result.folder), replacing(path) as temporary:
        write_netcdf(temporary, xr.Dataset(attrs=changed), onto=path)
    return replace(result, attrs={**result.attrs, **changed})


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
        If its file is damaged.
    """
    folder = Path(folder)
    path = folder / RESULT
    if not path.exists():
        begun = (folder / HEADER).exists()
        raise RequestError(
            f"{folder} holds no finished study ({RESULT} is missing). "
            + (
                "One was begun there: run its 'seakeep study' again, it goes on where it stopped."
                if begun
                else "Give the folder that 'seakeep study' or 'seakeep reproduce' wrote."
            )
        )
    try:
        with xr.open_dataset(path, engine="h5netcdf") as root:
            attrs = {key: _plain(value) for key, value in root.attrs.items()}
        groups = {}
        names = json.loads(attrs["groups"]) if attrs.get("format") == FORMAT else []
        for name in names:
            with xr.open_dataset(path, engine="h5netcdf", group=name, decode_times=False) as opened:
                groups[name] = opened.load()
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise DataError(
            f"{path} is damaged or no NetCDF file: {type(error).__name__} while reading it. Remove "
            "it and run the study again."
        ) from error
    if attrs.get("format") != FORMAT:
        raise RequestError(
            f"{path} was written in format {attrs.get('format', 'unknown')}, and this version of "
            f"seakeep reads format {FORMAT}. Run the study again in another folder."
        )
    return StudyResult(folder, attrs, groups)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
