"""A first campaign file, guessed from the headers of the files: what ``seakeep init`` writes."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomlkit
from tomlkit.items import Table

from seakeep.campaign.columns import Columns, is_unit
from seakeep.campaign.readers import read_columns, time_column
from seakeep.conventions import canonical_channel, conversion, si_unit
from seakeep.errors import RequestError

__all__ = ["draft_campaign", "suggest_channel"]

# What a column may be called, in the words of tanks in several countries: whole words, lower case.
_WORDS = {
    "surge": {"surge", "x", "avanzo", "jage"},
    "sway": {"sway", "y", "deriva"},
    "heave": {"heave", "z", "sussulto", "hiv", "pilonnement"},
    "roll": {"roll", "phi", "rollio", "rull", "roulis"},
    "pitch": {"pitch", "theta", "beccheggio", "stamp", "tangage"},
    "yaw": {"yaw", "psi", "imbardata", "gir", "lacet"},
}
_ACCELERATION = {"acc", "accel", "acceleration", "accelerazione", "a", "dd", "acel"}
_RATE = {"rate", "vel", "velocity", "gyro", "speed", "velocita", "d", "dot"}
_WAVE = {"wp", "wg", "wave", "eta", "probe", "wavegauge", "waveprobe", "elevation", "onda", "sonda",
         "zeta", "waveheight", "bolge"}  # fmt: skip
_LOAD = {"tension", "load", "force", "mooring", "moor", "line", "tiro", "tensione", "carico",
         "kraft", "fairlead"}  # fmt: skip
_BOW = {"bow", "fwd", "forward", "prua", "fore"}
_STERN = {"stern", "aft", "poppa"}
_SIDE = {"sb": "starboard", "stb": "starboard", "starboard": "starboard", "ps": "port",
         "port": "port", "portside": "port"}  # fmt: skip
_DIMENSIONS = ("m", "rad", "m/s", "rad/s", "m/s^2", "rad/s^2", "N")


@dataclass(frozen=True)
class _Guess:
    column: str
    header: str
    unit: str | None
    channel: str | None  # None: nothing fits; the column is listed as a comment
    why: str = ""
    assumed_unit: bool = False


def draft_campaign(files: Sequence[Path | str], folder: Path | str | None = None) -> str:
    """Draft a campaign file from the files of its runs.

    Parameters
    ----------
    files : sequence of Path or str
        Files of one campaign, with the same columns; the last one is proposed for testing.
    folder : Path or str, optional
        Folder in which the campaign file will lie: paths are written relative to it. The default
        is the working folder.

    Returns
    -------
    str
        The TOML, with comments that say what was guessed; it can be read and prepared as it is.
        Columns that fit no channel are listed as comments.

    Raises
    ------
    RequestError
        If no file is given, or no channel can be made of the first one.
    DataError
        If a file cannot be read.
    """
    if not files:
        raise RequestError(
            "no file was given. Name the runs' files: seakeep init RUN1.csv RUN2.csv"
        )
    paths = [Path(file) for file in files]
    tables = [read_columns(path) for path in paths]
    time = time_column(tables[0])
    guesses = _guesses(paths, tables, time)
    if not any(guess.channel for guess in guesses):
        listed = ", ".join(tables[0].names)
        raise RequestError(
            f"{paths[0]}: no column has numbers that a channel could be made of (columns: "
            f"{listed}). Check delimiter and decimal mark of the file."
        )
    document = tomlkit.document()
    document.add(tomlkit.comment("Draft of a campaign. Read every line that says 'guessed', then"))
    document.add(tomlkit.comment("run: seakeep fit THIS-FILE -o model.nc"))
    _general(document, paths, folder)
    _files_table(document, tables[0], time)
    _channels(document, guesses)
    _runs(document, paths, folder)
    rate = _rate(tables[0], time)
    _settings(document, guesses, rate, _wave_period(tables[0], guesses, rate))
    return tomlkit.dumps(document)


def _guesses(paths: list[Path], tables: list[Columns], time: str | None) -> list[_Guess]:
    first, found, taken = tables[0], [], set()
    for column in first.names:
        if column == time:
            continue
        header, unit = first.headers.get(column, column), first.units.get(column)
        elsewhere = [
            path.name
            for path, table in zip(paths, tables, strict=True)
            if table.find(column) is None or column in table.faults
        ]
        why = ""
        if column in first.faults:
            why = "not all of it are numbers, or its name is there twice"
        elif elsewhere:
            why = f"missing or unusable in {', '.join(elsewhere[:3])}"
        elif gapped := [
            path.name
            for path, table in zip(paths, tables, strict=True)
            if not np.isfinite(table.values[column]).all()
        ]:
            why = f"has gaps in {', '.join(gapped[:3])}"
        if unit is not None and not is_unit(unit):
            why = why or f"its unit '{unit}' is not known; state unit = '…'"
        channel = None if why else suggest_channel(column, unit)
        if channel is not None:
            stem, count = channel, 2
            while channel in taken:
                channel, count = f"{stem}_{count}", count + 1
            taken.add(channel)
        assumed = unit is None
        canonical = canonical_channel(channel) if channel else None
        unit = unit if unit is not None else (canonical.units if canonical else "-")
        found.append(_Guess(column, header, unit, channel, why, assumed))
    return found


def _words(column: str) -> list[str]:
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Za-z])(?=\d)|(?<=\d)(?=[A-Za-z])", " ", column)
    return [word for word in re.split(r"[^A-Za-z0-9]+", spaced.lower()) if word]


def suggest_channel(column: str, unit: str | None) -> str:
    """Name for a column: a canonical one if words and unit speak for it, else the column's own."""
    words = _words(column)
    dimension = None if unit is None else si_unit(unit)
    numbers = [word for word in words if word.isdigit()]
    sides = [_SIDE[word] for word in words if word in _SIDE]

    def fits(name: str) -> bool:
        canonical = canonical_channel(name)
        return canonical is not None and dimension in (None, canonical.units)

    if _WAVE & set(words):
        place = [w for w in words if w in ("fwd", "cog", "aft", "mid")] + numbers
        name = "eta_" + ("_".join(place) or "1")
        if fits(name):
            return name
    for motion, known in _WORDS.items():
        if not known & set(words):
            continue
        suffix = "_acceleration" if _ACCELERATION & set(words) else ""
        suffix = suffix or ("_rate" if _RATE & set(words) else "")
        if dimension is not None and not fits(motion + suffix):
            suffix = next((s for s in ("", "_rate", "_acceleration") if fits(motion + s)), suffix)
        # Of two sensors of one acceleration, neither is the motion of the body.
        if fits(motion + suffix) and not sides and not _LOAD & set(words):
            return motion + suffix
    if _LOAD & set(words):
        ends = ["bow"] * bool(_BOW & set(words)) + ["stern"] * bool(_STERN & set(words))
        ends = ends or sides or numbers
        if ends and not _names_motion(words) and fits(name := "mooring_" + "_".join(ends)):
            return name
    free = "_".join(words) or "channel"
    free = free if not free[0].isdigit() else f"column_{free}"
    canonical = canonical_channel(free)
    return f"{free}_signal" if canonical and not fits(free) else free


def _names_motion(words: Iterable[str]) -> bool:
    """Whether one of the words names a motion, as in "sway force"."""
    return any(known & set(words) for known in _WORDS.values())


def _rate(table: Columns, time: str | None) -> float | None:
    if time is None or time not in table.values or table.values[time].size < 3:
        return table.sampling_rate
    unit = table.units.get(time, "s").split(" since ")[0]
    step = float(np.median(np.diff(table.values[time])))
    step *= conversion(unit, "s", f"the time column '{time}'") if is_unit(unit) else 1.0
    return 1.0 / step if step > 0 else None


def _wave_period(table: Columns, guesses: list[_Guess], rate: float | None) -> float | None:
    """Period of the spectral peak of the first wave channel, s; it only suggests a rate."""
    wave = next((g.column for g in guesses if (g.channel or "").startswith("eta_")), None)
    if wave is None or rate is None or table.values[wave].size < 64:
        return None
    series = table.values[wave] - table.values[wave].mean()
    power = np.abs(np.fft.rfft(series * np.hanning(series.size))) ** 2
    peak = 4 + int(np.argmax(power[4:]))  # slower than a quarter of the record is drift
    return float(series.size / (peak * rate)) if power[peak] > 0 else None


def _relative(path: Path, folder: Path | str | None) -> str:
    """Path as the campaign should write it; the data folder, where it is named, by its name."""
    data = os.environ.get("SEAKEEP_DATA_DIR")
    absolute = path.expanduser().resolve()
    if data and absolute.is_relative_to(Path(data).expanduser().resolve()):
        inside = absolute.relative_to(Path(data).expanduser().resolve())
        return "${SEAKEEP_DATA_DIR}/" + inside.as_posix()
    return Path(os.path.relpath(absolute, Path(folder or ".").resolve())).as_posix()


def _general(document: tomlkit.TOMLDocument, paths: list[Path], folder: Path | str | None) -> None:
    general = tomlkit.table()
    general.add("name", (paths[0].resolve().parent.name or "campaign"))
    general.add("scale_factor", 1.0)
    general["scale_factor"].comment("full-scale length over model length")
    general.add(tomlkit.comment("encounter_period = 1.64  # s; left out, it is measured"))
    document.add("campaign", general)
    rig = tomlkit.table()
    rig.add(tomlkit.comment("water_depth = 3.6  # m; 'inf' for deep water"))
    rig.add(tomlkit.comment("[rig.positions]  # channel = x in m along the waves"))
    document.add("rig", rig)


def _files_table(document: tomlkit.TOMLDocument, table: Columns, time: str | None) -> None:
    files = tomlkit.table()
    if time is not None:
        files.add("time", time)
        files["time"].comment("guessed from its name")
    elif table.sampling_rate is None:
        files.add("sampling_rate", 100.0)
        files["sampling_rate"].comment("ASSUMED: the files have no time column. Correct it")
    document.add("files", files)


def _channels(document: tomlkit.TOMLDocument, guesses: list[_Guess]) -> None:
    channels = tomlkit.table(is_super_table=True)
    document.add(tomlkit.nl())
    document.add(tomlkit.comment("A channel is sign * (reading + offset), converted to SI."))
    skipped = []
    for guess in guesses:
        if guess.channel is None:
            skipped.append(guess)
            continue
        table = tomlkit.table()
        table.add("column", guess.column)
        if guess.assumed_unit:
            table.add("unit", guess.unit)
            table["unit"].comment("ASSUMED: the file states none. Correct it")
        canonical = canonical_channel(guess.channel)
        if canonical is None:
            table.add("long_name", guess.column)
        else:
            table["column"].comment(f"guessed: {canonical.long_name}; header '{guess.header}'")
        channels.add(guess.channel, table)
    document.add("channels", channels)
    if skipped:
        document.add(tomlkit.nl())
    for guess in skipped:
        document.add(tomlkit.comment(f"column '{guess.header}' left out: {guess.why}"))
    document.add(tomlkit.nl())
    for line in (
        "Channels made from others, such as:",
        "[derived.heave_acceleration]",
        'expression = "0.5*(acc_heave_sb + acc_heave_ps)"  # + - * / **, square abs mean sqrt',
        "[derived.heave]",
        'from = "heave_acceleration"',
        'step = "integrate"  # or differentiate, low_pass, envelope_squared',
        "times = 2",
        "band = [0.4, 5.0]  # Hz",
    ):
        document.add(tomlkit.comment(line))


def _runs(document: tomlkit.TOMLDocument, paths: list[Path], folder: Path | str | None) -> None:
    runs = tomlkit.table(is_super_table=True)
    names = _run_names(paths)
    for i, (name, path) in enumerate(zip(names, paths, strict=True)):
        table = tomlkit.table()
        table.add("file", _relative(path, folder))
        if len(paths) == 1:
            table.add(tomlkit.comment("train = [0.0, 60.0]  # s; with test = [60.0, inf]"))
        table.add("role", "test" if 0 < i == len(paths) - 1 else "train")
        table["role"].comment("guessed: the first runs train, the last one tests")
        table.add(tomlkit.comment("span = [10.0, inf]  # s; cut the start-up of the waves off"))
        runs.add(name, table)
    document.add("runs", runs)


def _run_names(paths: list[Path]) -> list[str]:
    stems = [re.sub(r"[^A-Za-z0-9_+-]+", "_", p.name.split(".")[0]).strip("_+-") for p in paths]
    names: list[str] = []
    for stem in stems:
        name, count = stem or "run", 2
        while name in names:
            name, count = f"{stem or 'run'}_{count}", count + 1
        names.append(name)
    return names


def _settings(
    document: tomlkit.TOMLDocument,
    guesses: list[_Guess],
    rate: float | None,
    period: float | None,
) -> None:
    preparation = tomlkit.table()
    names = [guess.channel for guess in guesses if guess.channel]
    waves = [name for name in names if name.startswith("eta_")]
    if rate is not None:
        preparation.add(tomlkit.comment(f"the files have {rate:.6g} samples a second"))
    every = 1 if rate is None or period is None else int(period * rate / 32)
    if rate is not None and period is not None and every > 1:
        preparation.add("sampling_rate", float(f"{rate / every:.6g}"))
        preparation["sampling_rate"].comment(
            f"Hz; guessed: about 32 samples a wave of {period:.3g} s"
        )
    else:
        preparation.add(tomlkit.comment("sampling_rate = 25.0  # Hz; left out, the files' own"))
    preparation.add(tomlkit.comment("steps_per_period = 32  # instead: samples a mean period"))
    document.add("preparation", preparation)
    motions = [n for n in names if (c := canonical_channel(n)) and n not in waves and c.units]
    states = motions or [n for n in names if n not in waves] or names[:1]
    document.add("model", _model(states, [w for w in waves if w not in states]))


def _model(states: list[str], inputs: list[str]) -> Table:
    model = tomlkit.table()
    model.add("preset", "recommended")
    model.add("states", list(states))
    model["states"].comment("guessed: what the model forecasts")
    model.add("inputs", list(inputs))
    model["inputs"].comment("guessed: the wave probes that drive it")
    model.add(tomlkit.comment("in samples, in place of the preset's:"))
    model.add(tomlkit.comment("state_delays = 32    # one encounter period"))
    model.add(tomlkit.comment("input_delays = 160   # five encounter periods"))
    model.add(tomlkit.comment("ridge = 0.15625      # 100/640, with the next line"))
    model.add(tomlkit.comment('ridge_scale = "per_snapshot"'))
    model.add(tomlkit.comment('delay_rows = "exact"'))
    return model
