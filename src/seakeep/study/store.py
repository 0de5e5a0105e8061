"""Results on disk: sealed NetCDF files of groups, one per finished unit, then one for the study."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import xarray as xr
from filelock import FileLock, Timeout

from seakeep.arrays import Datasets, FloatArray, Groups
from seakeep.errors import RequestError, SeakeepError, warn
from seakeep.executor import versions
from seakeep.files import (
    check_report,
    head_of,
    is_there,
    load_groups,
    write_netcdf,
)

RESULT = "study.nc"
LOCK = "study.lock"
UNITS = "units"

STUDY, UNIT = "study", "unit of a study"
"""Kinds of these files."""


class StorageError(SeakeepError):
    """Results could not be written: finished work is kept, and the same command continues."""


@contextmanager
def storing(folder: Path) -> Iterator[None]:
    """Say why results could not be written, and the remedy."""
    try:
        yield
    except (RequestError, OSError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        if not isinstance(cause, OSError):
            raise
        raise StorageError(
            f"results could not be written to {folder}: {cause.strerror or cause}. What was "
            "finished is kept. Free space on the disk, or choose a folder that you may write to; "
            "the same command then continues where it stopped."
        ) from error


def write_groups(path: Path, kind: str, attrs: Mapping[str, Any], groups: Datasets) -> None:
    """Write groups into one sealed file, renamed into place; errors as :func:`storing`."""
    with storing(path.parent):
        write_netcdf(path, xr.Dataset(attrs={**head_of(kind), **attrs}), groups)


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

    def check(self) -> StudyResult | None:
        """Refuse, before the work, a folder that cannot be written or holds another study.

        A study that was started and has no finished unit is none: nothing of it is lost.

        Returns
        -------
        StudyResult or None
            The result, where this study was finished before.

        Raises
        ------
        RequestError
            If the folder holds the results of another study, or of other versions, or cannot be
            made or written.
        DataError
            If its result is damaged.
        StorageError
            If the disk fails.
        """
        units = self.folder / UNITS
        with storing(self.folder):
            units.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=units).close()
        result = None
        if (self.folder / RESULT).exists():
            result = read_result(self.folder)
            started = result.attrs
        elif finished := sorted(units.glob("*.nc")):
            readable = (groups for path in finished if (groups := _unit(path)))
            started = next((groups[""].attrs for groups in readable), {})
        else:
            check_report(self.folder)
            return None
        if not started:
            raise RequestError(
                f"{self.folder} holds results, and none of them says of which study: they are "
                "damaged, or of another format of seakeep. Choose another folder (-o), or "
                "remove this one."
            )
        if started["digest"] != self.digest:
            raise RequestError(
                f"{self.folder} holds the results of another study: its digest starts with "
                f"{started['digest'][:12]} and this study's with {self.digest[:12]}. "
                "Settings, campaign or raw files have changed since. Give another folder with -o, "
                "or remove this one."
            )
        before, now = json.loads(started.get("versions", "{}")), versions()
        changed = [f"{k} {before.get(k)} (now {v})" for k, v in now.items() if before.get(k) != v]
        if changed:
            raise RequestError(
                f"{self.folder} was started with {', '.join(changed)}; arrays of both would be "
                "mixed. Give another folder with -o, or remove this one."
            )
        return result

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
        # What a killed process had begun: nobody else works in the folder.
        litter = [each for each in self.folder.rglob(".*.tmp") if each.is_file()]
        for each in litter:
            each.unlink(missing_ok=True)
        if litter:
            warn(f"{self.folder}: removed {len(litter)} unfinished file(s) of a killed run.")
        try:
            yield
        finally:
            with suppress(OSError):  # Windows does not remove a file that is open
                path.unlink()
            lock.release()

    def write(self, name: str, groups: Groups) -> None:
        """Keep the groups of a finished unit; errors as :func:`write_groups`."""
        attrs = {"digest": self.digest, "versions": json.dumps(versions())}
        write_groups(self.folder / UNITS / f"{name}.nc", UNIT, attrs, groups)

    def read(self, name: str) -> Groups | None:
        """Groups of a finished unit; None where it is not finished, or damaged."""
        groups = _unit(self.folder / UNITS / f"{name}.nc")
        return groups if groups and groups.pop("").attrs["digest"] == self.digest else None

    def clear(self) -> None:
        """Remove the units; for when all of them are in the result."""
        for path in (self.folder / UNITS).glob("*.nc"):
            path.unlink(missing_ok=True)
        with suppress(OSError):  # files of others stay
            (self.folder / UNITS).rmdir()


def _unit(path: Path) -> Groups | None:
    """What the file of a unit holds; None where there is none, or it is damaged."""
    with suppress(SeakeepError):
        return load_groups(path, UNIT)
    return None


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
    groups: Groups

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Settings of the study as plain data."""
        return json.loads(self.attrs["settings"])

    @property
    def encounter_period(self) -> float:
        """Mean encounter period, s."""
        return float(self.attrs["encounter_period"])

    @property
    def dt(self) -> float:
        """Time step, s."""
        return float(self.attrs["dt"])

    @property
    def level(self) -> float:
        """Probability of the bands."""
        return float(self.settings["statistics"]["level"])

    @cached_property
    def model_settings(self) -> dict[str, Any]:
        """Per model ``kind``, ``role``, ``preset``, ``ensemble``, ``n_members`` and ``settings``.

        ``settings`` gives for each key its ``value`` (a JSON value) and its ``source``: "stated",
        "preset", "study" (the study's seed) or "default".
        """
        return json.loads(self.attrs["models"])

    @property
    def conditional_on(self) -> dict[str, str]:
        """Measured output that forecasts read after their start, of each model that does so."""
        return {
            model: self.setting(model, "alignment.surge_channel")
            for model in self.models
            if self.setting(model, "alignment.surge") == "measured"
        }

    def setting(self, model: str, key: str) -> Any:
        """Value of a setting of a model; None where it has none of that name."""
        return self.model_settings[model]["settings"].get(key, {}).get("value")

    @property
    def models(self) -> list[str]:
        """Names of the models, in the order of the study file."""
        return list(self.model_settings)

    @property
    def channels(self) -> list[str]:
        """Channels that are forecast."""
        return [str(name) for name in self.groups["channels"]["channel"].values]

    @property
    def tests(self) -> Groups:
        """Test sets by name."""
        return {name: self.groups[f"tests/{name}"] for name in self.settings["tests"]}

    @property
    def prepared(self) -> Groups:
        """Prepared runs with all of their channels, flags and findings, by name."""
        return {
            str(name): self.groups[f"prepared/{name}"] for name in self.groups["runs"]["run"].values
        }

    @property
    def is_calibrated(self) -> bool:
        """Whether bands of ensembles are calibrated."""
        return "calibration" in self.groups

    @cached_property
    def ensembles(self) -> list[str]:
        """Names of the models that are ensembles."""
        return [name for name, each in self.model_settings.items() if each["ensemble"]]

    def label_of(self, test: str) -> str:
        """Words for a test set."""
        return str(self.settings["tests"][test]["label"] or test.replace("_", " "))

    def sea_of(self, test: str) -> str:
        """Words for a test set beside others: its label without that the waves are regular."""
        return self.label_of(test).removeprefix("regular, ")

    def errors(self, test: str, model: str, measure: str = "nrmse") -> FloatArray:
        """Errors of a model in all judged cells of a test set, shape (cell, channel)."""
        data = self.tests[test]
        return data["error"].sel(model=model, measure=measure).values[data["judged"].values]

    def words_of(self, channel: str) -> str:
        """Words for a channel of the study: what the campaign calls it."""
        return str(self.groups["channels"]["long_name"].sel(name=channel).values)


def write_result(result: StudyResult) -> None:
    """Write a result into its folder; errors as :func:`write_groups`."""
    write_groups(result.folder / RESULT, STUDY, result.attrs, result.groups)


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
        If there is no finished study.
    DataError
        If its file is damaged, was altered since it was written, or has another format.
    """
    folder = Path(folder)
    if not is_there(folder / RESULT):
        started = any((folder / UNITS).glob("*.nc"))
        raise RequestError(
            f"{folder} holds no finished study ({RESULT} is missing). "
            + (
                "One was started there: run its 'seakeep study' again to continue."
                if started
                else "Give the folder that 'seakeep study' or 'seakeep reproduce' wrote."
            )
        )
    groups = load_groups(folder / RESULT, STUDY)
    return StudyResult(folder, groups.pop("").attrs, groups)
