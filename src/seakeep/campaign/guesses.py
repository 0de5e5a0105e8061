"""What columns, files and loggers of a campaign may be, guessed from their names and units."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.conventions import canonical_channel, si_unit
from seakeep.errors import DataError
from seakeep.formats.columns import Columns, is_unit, named_unit
from seakeep.signals import uniform_step

__all__ = [
    "MOTIONS",
    "File",
    "Guess",
    "arranged",
    "guess_channels",
    "is_acceleration",
    "is_noise",
    "is_trigger",
    "noise_of",
    "rising_column",
    "suggest_channel",
    "waves_of",
    "words_of",
]

# What a column may be called, in the words of tanks in several countries: whole words, lower case.
_WORDS = {
    "surge": {"surge", "x", "avanzo", "jage"},
    "sway": {"sway", "y", "deriva"},
    "heave": {"heave", "z", "sussulto", "hiv", "pilonnement"},
    "roll": {"roll", "phi", "rollio", "rull", "roulis"},
    "pitch": {"pitch", "theta", "beccheggio", "stamp", "tangage"},
    "yaw": {"yaw", "psi", "imbardata", "gir", "lacet"},
}
MOTIONS = tuple(_WORDS)
"""The six motions, by their canonical names."""
_TURNS = {"roll": _WORDS["roll"] | {"x"}, "pitch": _WORDS["pitch"] | {"y"},
          "yaw": _WORDS["yaw"] | {"z"}}  # fmt: skip
_ACCELERATION = {"acc", "accel", "acceleration", "accelerazione", "a", "dd", "acel"}
_RATE = {"rate", "vel", "velocity", "gyro", "speed", "velocita", "d", "dot"}
_WAVE = {"wp", "wg", "wave", "eta", "probe", "wavegauge", "waveprobe", "elevation", "onda", "sonda",
         "zeta", "waveheight", "bolge", "waves", "probes", "gauges"}  # fmt: skip
_LOAD = {"tension", "load", "force", "mooring", "moor", "line", "tiro", "tensione", "carico",
         "kraft", "fairlead"}  # fmt: skip
_BOW = {"bow", "fwd", "forward", "prua", "fore"}
_STERN = {"stern", "aft", "poppa"}
_SIDE = {"sb": "starboard", "stb": "starboard", "starboard": "starboard", "ps": "port",
         "port": "port", "portside": "port"}  # fmt: skip
_TRIGGER = {"trigger", "trig", "sync", "synch", "ttl", "lamp", "led"}
_REGULAR = {"regular", "reg", "monochromatic"}
_IRREGULAR = {"irregular", "irreg", "irr", "random", "jonswap", "bretschneider", "spectrum"}
LONG = 64
"""Samples that a column must have for its waves or its noise to be judged."""
USABLE = 0.9
"""Part of a column that must be numbers for it to become a channel with gaps."""


@dataclass(frozen=True)
class File:
    """A file of a run: of which run and which logger; its columns, and that which is time."""

    path: Path
    run: str
    logger: str
    table: Columns
    time: str | None


@dataclass(frozen=True)
class Guess:
    """What a column may be; `channel` is None where nothing fits, `noise` where nothing moves.

    `named_unit` says that the unit is what the column's name ends on.
    """

    column: str
    header: str
    unit: str | None
    channel: str | None
    logger: str = ""
    why: str = ""
    assumed_unit: bool = False
    named_unit: bool = False
    gaps: bool = False
    noise: bool = False


def is_trigger(column: str) -> bool:
    """Whether a column may hold the pulses that all loggers recorded."""
    return bool(_TRIGGER & set(words_of(column)))


def is_acceleration(name: str) -> bool:
    """Whether a name speaks of an acceleration."""
    return bool(_ACCELERATION & set(words_of(name)))


def waves_of(run: str) -> str | None:
    """Say "regular" or "irregular" if the name of a run does."""
    words = set(words_of(run))
    if words & _IRREGULAR:
        return "irregular"
    return "regular" if words & _REGULAR else None


def _plain(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9_+-]+", "_", text).strip("_+-") or "run"


def _stem(path: Path) -> str:
    return _plain(path.name.split(".")[0])


def _by_folder(path: Path) -> tuple[str, str]:
    folder = _plain(path.resolve().parent.name)
    return folder, _stem(path).removeprefix(folder).strip("_+-") or _stem(path)


def _by_name(paths: Sequence[Path], own: Sequence[set[str]]) -> list[tuple[str, str]]:
    """Run and logger, where files of like columns end on the same words."""
    stems = [re.split(r"[_-]+", _stem(path)) for path in paths]
    keys = []
    for words, columns in zip(stems, own, strict=True):
        alike = [s for s, other in zip(stems, own, strict=True) if _alike(columns, other)]
        count = 0
        while count < len(words) and len({tuple(s[-count - 1 :]) for s in alike}) == 1:
            count += 1
        at = len(words) - (count if len(alike) > 1 else 1)
        keys.append(("_".join(words[:at]), "_".join(words[at:])))
    return keys


def _alike(one: set[str], other: set[str]) -> bool:
    return len(one & other) >= 0.5 * min(len(one), len(other))


def arranged(
    paths: Sequence[Path], tables: Sequence[Columns], times: Sequence[str | None]
) -> list[File]:
    """Find out which file belongs to which run and logger.

    Files are of several loggers where those of one run have different columns, and those of one
    logger the same: ``RUN/LOGGER.csv`` or ``RUN_LOGGER.csv``. Otherwise each file is a run, called
    as its folder where the files are called alike.
    """
    own = [
        {n for n in table.names if n != time and not is_trigger(n)}
        for table, time in zip(tables, times, strict=True)
    ]
    for keys in ([_by_folder(path) for path in paths], _by_name(paths, own)):
        if _fits(keys, own):
            break
    else:
        stems = [_stem(path) for path in paths]
        folders = [_by_folder(path)[0] for path in paths]
        if len(set(stems)) == 1 and len(set(folders)) > 1:
            stems = folders
        keys = [(name, "") for name in _numbered(stems)]
    return [
        File(path, run, logger, table, time)
        for path, (run, logger), table, time in zip(paths, keys, tables, times, strict=True)
    ]


def _fits(keys: Sequence[tuple[str, str]], own: Sequence[set[str]]) -> bool:
    runs, loggers = {run for run, _ in keys}, {logger for _, logger in keys}
    if len(set(keys)) < len(keys) or len(runs) == len(keys) or "" in runs | loggers:
        return False
    for i, (run, logger) in enumerate(keys):
        for j, (other, same) in enumerate(keys[:i]):
            alike = _alike(own[i], own[j])
            if (run == other and alike) or (logger == same and not alike):
                return False
    return True


def _numbered(stems: Sequence[str]) -> list[str]:
    names: list[str] = []
    for stem in stems:
        name, count = stem, 2
        while name in names:
            name, count = f"{stem}_{count}", count + 1
        names.append(name)
    return names


def guess_channels(files: Sequence[File]) -> list[Guess]:
    """Guess a channel for each column of the first file of each logger."""
    found: list[Guess] = []
    taken: set[str] = set()
    for first in {file.logger: file for file in reversed(files)}.values():
        same = [file for file in files if file.logger == first.logger]
        for column in first.table.names:
            if column == first.time or (first.logger and is_trigger(column)):
                continue
            if is_trigger(column):
                header = first.table.headers.get(column, column)
                found.append(Guess(column, header, None, None, why="pulses of a trigger"))
                continue
            found.append(_guess(column, same, taken))
    order = list(dict.fromkeys(file.logger for file in files))
    return sorted(found, key=lambda guess: order.index(guess.logger))


def _guess(column: str, files: Sequence[File], taken: set[str]) -> Guess:
    table, logger = files[0].table, files[0].logger
    header, unit = table.headers.get(column, column), table.units.get(column)
    name, named = (column, None) if unit is not None else named_unit(column)
    if named is not None and si_unit(named) == "s":  # no channel is a time: "Tension_s" is a side
        name, named = column, None
    unit = unit if unit is not None else named
    why, gaps = _fault(column, files)
    if unit is not None and not is_unit(unit):
        why = why or f"its unit '{unit}' is not known; state unit = '…'"
    # One file a run may be that of one logger, whose name tells what it measured.
    channel = None if why else suggest_channel(name, unit, logger or _stem(files[0].path))
    if channel is not None:
        stem, count = channel, 2
        while channel in taken:
            channel, count = f"{stem}_{count}", count + 1
        taken.add(channel)
    assumed = unit is None
    canonical = canonical_channel(channel) if channel else None
    unit = unit if unit is not None else (canonical.units if canonical else "-")
    noise = not why and all(is_noise(file.table.values[column]) for file in files)
    return Guess(
        column, header, unit, channel, logger, why, assumed, named is not None, gaps, noise
    )


def is_noise(series: FloatArray) -> bool:
    """Whether most of a column's variance has no memory from one sample to the next."""
    series = series[np.isfinite(series)]
    if series.size < LONG:
        return False
    return bool(noise_of(series) > np.sqrt(0.5) * float(series.std()) > 0)


def noise_of(series: FloatArray) -> float:
    """Standard deviation of a series' white noise, by its second differences.

    Those of white noise have six times its variance, and know no slope.
    """
    return 1.4826 * float(np.median(np.abs(np.diff(series, 2)))) / float(np.sqrt(6.0))


def _fault(column: str, files: Sequence[File]) -> tuple[str, bool]:
    """Why a column cannot be a channel, if it cannot; and whether it has gaps."""
    if column in files[0].table.faults:
        return "not all of it are numbers, or its name is there twice", False
    bad = [f for f in files if f.table.find(column) is None or column in f.table.faults]
    if bad:
        return f"missing or unusable in {_listed(bad)}", False
    there = {id(f): float(np.mean(np.isfinite(f.table.values[column]))) for f in files}
    if gapped := [f for f in files if there[id(f)] < USABLE]:
        return f"has gaps in {_listed(gapped)}", True
    if all(_step_of(f.table.values[column]) == 1.0 for f in files):
        return "it counts; if it counts seconds, state time = …", False
    return "", min(there.values()) < 1


def rising_column(table: Columns) -> str | None:
    """Name of the first column that rises evenly, as times do; None if there is none.

    One that a unit says to be something else is none, nor is one that counts 1, 2, 3.
    """
    for column, series in table.values.items():
        unit = table.units.get(column) or named_unit(column)[1]
        if unit is not None and not (is_unit(unit) and si_unit(unit) == "s"):
            continue
        if _step_of(series) not in (None, 1.0):
            return column
    return None


def _step_of(series: FloatArray) -> float | None:
    """Step of a column that rises evenly; None for any other."""
    if series.size < LONG or not np.all(np.diff(series) > 0):
        return None
    try:
        return uniform_step(series)
    except DataError:
        return None


def _listed(files: Sequence[File]) -> str:
    return ", ".join(f"{f.run}/{f.path.name}" if f.logger else f.path.name for f in files[:3])


def words_of(column: str) -> list[str]:
    """Words of a name, lower case: split at signs, digits and changes of case."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Za-z])(?=\d)|(?<=\d)(?=[A-Za-z])", " ", column)
    return [word for word in re.split(r"[^A-Za-z0-9]+", spaced.lower()) if word]


def _fits_unit(name: str, dimension: str | None) -> bool:
    canonical = canonical_channel(name)
    return canonical is not None and dimension in (None, canonical.units)


def _motion(words: Sequence[str], dimension: str | None) -> str | None:
    """Canonical motion that words and unit speak for."""
    # Of two sensors of one acceleration, neither is the motion of the body; nor is a load.
    if set(words) & (set(_SIDE) | _LOAD):
        return None
    turns = dimension is not None and dimension.startswith("rad")
    names: dict[str, set[str]] = {**_WORDS, **(_TURNS if turns else {})}
    for motion, known in names.items():
        if not known & set(words):
            continue
        suffix = "_acceleration" if _ACCELERATION & set(words) else ""
        suffix = suffix or ("_rate" if _RATE & set(words) else "")
        others: tuple[str, ...] = () if dimension is None else ("", "_rate", "_acceleration")
        for each in (suffix, *others):
            if _fits_unit(motion + each, dimension):
                return motion + each
    return None


def suggest_channel(column: str, unit: str | None, logger: str = "") -> str:
    """Name for a column: a canonical one if words and unit speak for it, else the column's own.

    Parameters
    ----------
    column : str
        Name of the column.
    unit : str or None
        Unit that the file states.
    logger : str, optional
        Name of the logger: of "wave_probes", any length is an elevation.

    Returns
    -------
    str
        Name of the channel.
    """
    words = words_of(column)
    dimension = None if unit is None else si_unit(unit)
    numbers = [word for word in words if word.isdigit()]
    sides = [_SIDE[word] for word in words if word in _SIDE]

    if _WAVE & set(words):
        place = [w for w in words if w in ("fwd", "cog", "aft", "mid")] + numbers
        name = "eta_" + ("_".join(place) or "1")
        if _fits_unit(name, dimension):
            return name
    if dimension == "m" and _WAVE & set(words_of(logger)):
        return "eta_" + "_".join(words)
    if motion := _motion(words, dimension):
        return motion
    if _LOAD & set(words):
        ends = ["bow"] * bool(_BOW & set(words)) + ["stern"] * bool(_STERN & set(words))
        ends = ends or sides or numbers
        if ends and not _names_motion(words):
            name = "mooring_" + "_".join(ends)
            if _fits_unit(name, dimension):
                return name
    free = "_".join(words) or "channel"
    free = free if not free[0].isdigit() else f"column_{free}"
    canonical = canonical_channel(free)
    return f"{free}_signal" if canonical and not _fits_unit(free, dimension) else free


def _names_motion(words: Iterable[str]) -> bool:
    """Whether one of the words names a motion, as in "sway force"."""
    return any(known & set(words) for known in _WORDS.values())
