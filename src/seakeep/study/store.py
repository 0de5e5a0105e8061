"""Results on disk: one file per finished unit, then one NetCDF file for the study."""

from __future__ import annotations

import errno
import hashlib
import io
import json
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import xarray as xr
from filelock import FileLock, Timeout

from seakeep.errors import SHOWN, DataError, RequestError, SeakeepError, warn
from seakeep.files import (
    SEAL,
    check_report,
    is_there,
    read_bytes,
    read_sealed,
    replacing,
    write_netcdf,
)
from seakeep.models.checks import parsed, typed
from seakeep.models.store import rebuilt
from seakeep.study.schema import check_contents
from seakeep.study.settings import FORMAT

__all__ = [
    "RESULT",
    "StorageError",
    "StudyResult",
    "UnitFolder",
    "read_result",
    "relabel",
    "storing",
    "versions",
    "write_result",
]

RESULT = "study.nc"
HEADER = "study.json"
LOCK = "study.lock"
UNITS = "units"
MEND = "Remove it and run the study again."

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
        if found is not None and self._holds_results():
            _check_header(self.folder, found, self._header())
        elif not (self.folder / RESULT).exists():
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

    def _holds_results(self) -> bool:
        return (self.folder / RESULT).exists() or any((self.folder / UNITS).glob("*.npz"))

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
        with storing(self.folder), replacing(self._path(name)) as temporary:
            seal = hashlib.sha256(content.getvalue()).hexdigest().encode()
            temporary.write_bytes(content.getvalue() + SEAL + seal)

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

    @cached_property
    def model_settings(self) -> dict[str, Any]:
        """Per model its ``kind``, ``preset``, ``ensemble``, ``n_members`` and ``settings``.

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
        return any(name.startswith("calibration/") for name in self.groups)

    def is_ensemble(self, model: str) -> bool:
        """Whether a model is an ensemble."""
        return bool(self.model_settings[model]["ensemble"])

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
    kept = {**attrs, "format": FORMAT, "created": datetime.now(UTC).isoformat(timespec="seconds")}
    found = StudyResult(folder, kept, dict(groups))
    if finished is not None:
        finished(found)
    with storing(folder), replacing(folder / RESULT) as temporary:
        write_netcdf(temporary, xr.Dataset(attrs=kept), groups, _packing)
    return found


def _packing(group: xr.Dataset) -> dict[str, dict[str, object]]:
    return {
        str(key): {"zlib": True, "complevel": 1, "shuffle": True}
        for key, variable in group.data_vars.items()
        if variable.size > 4096 and variable.dtype.kind == "f"
    }


def relabel(result: StudyResult, words: Mapping[str, str]) -> StudyResult:
    """Write other names and labels into a finished result: attributes on which no array depends."""
    changed = {key: value for key, value in words.items() if result.attrs.get(key) != value}
    if not changed:
        return result
    path = result.folder / RESULT
    with storing(result.folder), replacing(path) as temporary:
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
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    part, groups = "the attributes", {}
    try:
        with h5netcdf.File(read_sealed(path), "r", decode_vlen_strings=True) as file:
            attrs = {key: _plain(value) for key, value in file.attrs.items()}
            if attrs.get("format", FORMAT) != FORMAT:
                raise RequestError(
                    f"{path} was written in format {attrs['format']!s:.{SHOWN}}, and this version "
                    f"of seakeep reads format {FORMAT}. Run the study again in another folder."
                )
            for name in rebuilt(path, lambda: _names(attrs), MEND):
                part = f"the group {name!r:.{SHOWN}}"
                opened = xr.open_dataset(H5NetCDFStore(file, group=name), decode_times=False)
                groups[name] = opened.load()
                opened.set_close(None)  # or what was read could not be handed to a worker
    except SeakeepError:
        raise
    except (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        raise DataError(
            f"{path} does not hold what seakeep writes: {part} cannot be read. {MEND}"
        ) from error
    attrs = rebuilt(path, lambda: check_contents(attrs, groups), MEND)
    return StudyResult(folder, attrs, groups)


def _names(attrs: Mapping[str, Any]) -> list[str]:
    return typed(list[str], parsed(str(attrs["groups"]), "groups"), "groups")


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value
