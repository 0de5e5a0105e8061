"""A run's file as a table with a time axis: :func:`read_table`; what its columns may be called."""

import hashlib
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.campaign.settings import FileSettings
from seakeep.conventions import conversion, same_unit, si_unit
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.files import expanded, sha256_of
from seakeep.formats import Columns, folder_reader, read_columns
from seakeep.formats.columns import is_unit, meant_column, named_unit
from seakeep.signals.time_axis import DAY, check_order, instant_text, past_midnight, usual_step
from seakeep.toml import packaged

CALLED = packaged("campaign/vocabulary.toml")
"""Words of columns, runs and places in files of others."""
COUNTED = 64
"""Times from which a column that counts 1, 2, 3 may count samples."""
DATENUM = 693960
"""MATLAB's number of the day from which Excel counts."""
UNIX = 25569
"""Excel's number of 1 January 1970."""
_VARIABLE = re.compile(r"\$\{([^}]*)\}")


def expand(file: str, folder: Path) -> Path:
    """Path of a file as a campaign writes it.

    Parameters
    ----------
    file : str
        The file; ``${NAME}`` stands for an environment variable, ``~`` for the home folder.
    folder : Path
        Folder to which a relative path is relative.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    RequestError
        If an environment variable is not set.
    """
    for name in _VARIABLE.findall(file):
        if not os.environ.get(name):
            raise RequestError(
                f"the file {file!r} needs the environment variable {name}, which is not set. "
                f"Set it to the folder of the data: export {name}=/path/to/data"
            )
    return folder / expanded(_VARIABLE.sub(lambda match: os.environ[match[1]], file))


def checksum(path: Path) -> str:
    """SHA-256 of a file, or of the names and contents of the files in a bag's folder."""
    if not folder_reader(path):
        return sha256_of(path)
    digest = hashlib.sha256()
    for part in sorted(filter(Path.is_file, path.iterdir())):
        digest.update(part.name.encode() + b"\0" + bytes.fromhex(sha256_of(part)))
    return digest.hexdigest()


def read_table(
    path: Path | str, options: FileSettings | None = None, columns: Iterable[str] | None = None
) -> xr.Dataset:
    """Read a run's file as it is: no channel is renamed, no value converted.

    Parameters
    ----------
    path : Path or str
        CSV or text (plain or gzip), MATLAB .mat of version 5 to 7.3, NetCDF or HDF5; TDMS with
        the extra ``tdms``; a ROS 2 bag (its folder) or an MCAP file with the extra ``ros``.
    options : FileSettings, optional
        What is known about the file: time column, delimiter, decimal mark and so on; what is left
        out is recognised.
    columns : iterable of str, optional
        The columns wanted, by name or full header; the default is all of them. A fault in a
        column that nobody wants is none.

    Returns
    -------
    xarray.Dataset
        Dimension ``time`` (s, increasing, not necessarily uniform); one variable per column, its
        attribute ``units`` what the file says, if it says something, and ``long_name`` its full
        header.

    Raises
    ------
    RequestError
        If the file, the time column or a wanted column does not exist.
    DataError
        If the file is damaged, a cell is not a number, or times are missing, repeated or unsorted.
    """
    path, options = Path(path), options or FileSettings()
    table = read_columns(path, options)
    from_midnight(table, options)
    time_name, time = times_of(path, table, options)
    # A run has one `time`: a column of that name beside the stated one is left out.
    others = [name for name in table.names if name not in (time_name, "time")]
    variables = {}
    for each in others if columns is None else columns:
        name = find_column(path, table, each)
        if name == "time":
            raise RequestError(
                f"{path}: the column 'time' cannot be a channel, since a run's instants have this "
                "name. Leave it out, or rename it in the file."
            )
        attributes = {"long_name": table.headers.get(name, name)}
        if name in table.units:
            attributes["units"] = table.units[name]
        variables[name] = ("time", table.values[name], attributes)
    if not variables:
        raise DataError(f"{path} holds times and no channel. Export the run again.")
    return xr.Dataset(variables, {"time": ("time", time, {"units": "s", "long_name": "time"})})


def find_column(path: Path, table: Columns, wanted: str) -> str:
    """Name of a wanted column; refuse one that is missing or at fault."""
    name = table.find(wanted)
    if name is None:
        meant = meant_column(wanted, [table])
        mend = "" if meant else " Name one of these, or give another file."
        raise RequestError(
            f"{path} has no column '{wanted}'.{meant} Its columns: {', '.join(table.names)}.{mend}"
        )
    if name in table.faults:
        raise DataError(table.faults[name])
    return name


def time_column(table: Columns, stated: str | None = None) -> str | None:
    """Name of the time column: the one stated, or the first with a usual name of times."""
    if stated is not None:
        return table.find(stated)
    for name in table.names:
        bare, unit = named_unit(name)
        if unit and si_unit(unit) != "s":
            bare = name
        if bare.strip().lower() in CALLED["time"]:
            return name
    return next((name for name, unit in table.units.items() if " since " in unit), None)


def from_midnight(table: Columns, options: FileSettings, day: float = 0.0) -> float:
    """Let dates count from a day, or else the midnight before the first; return that day.

    Dates are serial days, and where a day is given, so are times since 1970, as of Unix.
    """
    name, values = time_column(table, options.time), table.values
    unit = time_unit_of(table, name or "", options.time_unit)
    if name in values and values[name].size and is_unit(unit) and si_unit(unit) == "s":
        a_day, serial = DAY / conversion(unit, "s"), same_unit(unit, "d")
        days = values[name] / a_day
        if days[0] > 1e4 and (serial or day):
            days = (days if serial else days + UNIX) % DATENUM
            day = day or float(days[0] // 1)
            values[name] = np.round(DAY * (days - day), 6) / DAY * a_day
    return day


def time_unit_of(table: Columns, name: str, stated: str | None = None) -> str:
    """Unit of a time column: as stated, as its header says, as its name ends, or seconds."""
    named = named_unit(name)[1]
    return stated or _said_unit(table, name) or (named if named and si_unit(named) == "s" else "s")


def _said_unit(table: Columns, name: str) -> str:
    """Unit that a file's header states for its times, without an epoch; empty if it states none."""
    return table.units.get(name, "").split(" since ")[0].strip()


def time_step_of(table: Columns, name: str | None) -> float | None:
    """Step of a time column in s, gaps left out; None without one, or of too few values."""
    if name not in table.values or (times := table.values[name]).size < 3:
        return None
    step = (times[-1] - times[0]) / (times.size - 1)
    usual = usual_step(times)
    step = step if abs(step - usual) < 0.01 * abs(usual) else usual
    unit = time_unit_of(table, name)
    step *= conversion(unit, "s", f"the time column '{name}'") if is_unit(unit) else 1.0
    return step if step > 0 else None


def counts_samples(table: Columns, options: FileSettings) -> bool:
    """Whether the times count 1, 2, 3 and nothing says that these are seconds."""
    name = time_column(table, options.time)
    if name is None or options.time_unit or _said_unit(table, name) or named_unit(name)[1]:
        return False
    times = table.values[name]
    return times.size >= COUNTED and bool(times[0] in (0, 1) and np.all(np.diff(times) == 1))


def times_of(path: Path, table: Columns, options: FileSettings) -> tuple[str | None, FloatArray]:
    """Name of the time column, if there is one, and the instants, s, checked for their order."""
    name = time_column(table, options.time)
    rate = options.sampling_rate or table.sampling_rate
    if name is None and options.time is not None:
        raise RequestError(
            f"{path} has no time column '{options.time}'.{did_you_mean(options.time, table.names)} "
            f"Its columns: {', '.join(table.names)}. State one of them as time in [files]."
        )
    if name is None and not rate:
        raise RequestError(
            f"{path} has no column with a usual name of times. State time = 'NAME' or "
            f"sampling_rate (Hz) in [files]. Its columns: {', '.join(table.names)}."
        )
    if name is None or (options.sampling_rate and options.time is None):
        count = next((values.size for values in table.values.values()), 0)
        return name, check_order(np.arange(count) / (rate or 1.0), str(path))
    find_column(path, table, name)  # refuses one at fault
    stated, said = options.time_unit, _said_unit(table, name)
    unit = time_unit_of(table, name, stated)
    factor = conversion(unit, "s", f"the time column '{name}' of {path}")
    if stated and is_unit(said) and si_unit(said) == "s" and not same_unit(said, stated):
        raise RequestError(
            f"time_unit: '{stated}' is stated, and {path} says '{said}' for its time column "
            f"'{name}'. Leave time_unit out where the files say it; or, if the file is wrong, "
            "correct its header, or leave time and time_unit out and state sampling_rate (Hz) in "
            "[files]."
        )
    times = past_midnight(table.values[name] * factor)
    steps = np.diff(times)
    if (steps <= 0).any():
        double = pd.DataFrame(table.values).duplicated().to_numpy()
        if (steps < 0).any() and (np.diff(times[~double]) > 0).all():
            at = np.argmax(double)
            raise DataError(
                f"{double.sum()} row(s) of {path} are there twice, with the same time and the same "
                f"readings: the first is sample {at}, of {instant_text(times[at], 0)} s, which "
                f"stands at sample {np.argmax(times == times[at])} too. Remove the double rows; "
                "the times of the others are sorted."
            )
        # Double rows that follow one another are left to `check_order`.
        again = np.flatnonzero(steps == 0)
        if again.size and double[again + 1].mean() <= 0.5:
            first = again[0]
            raise DataError(
                f"the times of {path} repeat: {instant_text(times[first], 0)} s stands at samples "
                f"{first} and {first + 1} ({again.size} repetitions in all), and the readings "
                "beside them differ, so no row is double: the clock stood still, or is written "
                "with too few decimals. If the readings went on evenly, leave time out of [files] "
                "and state sampling_rate (Hz) there; of one logger of several, export the file "
                "without its times and state sampling_rate in [instruments.NAME]. Else export it "
                "with more decimals."
            )
    return name, check_order(times, str(path))


def is_wave(column: str) -> bool:
    """Whether a column is called as those of wave probes are, and not as a motion."""
    return "wave" in kinds_of(column) and not any(motions_of(column))


def words_of(column: str) -> list[str]:
    """Words of a name, lower case: split at signs, digits and changes of case."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Za-z])(?=\d)|(?<=\d)(?=[A-Za-z])", " ", column)
    return [word for word in re.split(r"[^A-Za-z0-9]+", spaced.lower()) if word]


def kinds_of(column: str) -> set[str]:
    """What the words of a name may mean, by the keys of the vocabulary."""
    words = words_of(column)
    return {kind for kind, called in CALLED.items() if not set(called).isdisjoint(words)}


def motions_of(column: str) -> Iterator[str]:
    """Canonical motions that the words of a name may mean, the likeliest first."""
    # Of two sensors of one acceleration, neither is the motion of the body; nor is load or wind.
    kinds, words = kinds_of(column), words_of(column)
    if kinds & {"sides", "load", "rotor"} or ("flow" in kinds and "motion" not in kinds):
        return
    said = next((f"_{kind}" for kind in ("acceleration", "rate") if kind in kinds), "")
    for motion, known in CALLED["motion"].items():
        if not set(known).isdisjoint(words):
            yield from (motion + each for each in (said, "", "_rate", "_acceleration"))
