"""A first campaign file, guessed from the headers of the files: what ``seakeep init`` writes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import tomlkit
from tomlkit.items import Table

from seakeep.campaign.draft_hints import (
    derived_examples,
    driving_wave,
    model_table,
    preparation_table,
)
from seakeep.campaign.guesses import (
    LONG,
    File,
    Guess,
    arranged,
    guess_channels,
    is_noise,
    is_trigger,
    noise_of,
    rising_column,
    suggest_channel,
    waves_of,
)
from seakeep.campaign.readers import time_column, time_step_of, time_unit_of
from seakeep.campaign.settings import FileSettings
from seakeep.conventions import canonical_channel
from seakeep.errors import DataError, RequestError
from seakeep.formats import read_columns
from seakeep.formats.columns import Columns, named_unit
from seakeep.signals import encounter_period

__all__ = ["draft_campaign"]

NOISE = 4.0
"""Standard deviations of a probe's noise that a wave must pass either way to count: one sample in
16 000 of normal noise lies beyond."""

REMOVE = "prepare warns of it: remove it"

LED = 0.9
"""Where noise shortens the counted period to less than this part, the draft states a hysteresis."""


def draft_campaign(
    files: Sequence[Path | str],
    folder: Path | str | None = None,
    options: Mapping[str, object] | None = None,
) -> str:
    """Draft a campaign file from the files of its runs.

    Parameters
    ----------
    files : sequence of Path or str
        Files of one campaign: one a run, all with the same columns; or one a logger and run,
        named ``RUN/LOGGER.csv`` or ``RUN_LOGGER.csv``. The last run is proposed for testing.
    folder : Path or str, optional
        Folder in which the campaign file will lie: paths are written relative to it. The default
        is the working folder.
    options : mapping of str to object, optional
        Keys of ``[files]`` that are known, such as ``skip_rows``; the draft states them.

    Returns
    -------
    str
        The TOML, with comments that say what was guessed; it can be read and prepared as it is.
        Columns that fit no channel are listed as comments.

    Raises
    ------
    RequestError
        If no file is given, or no channel can be made of the files.
    DataError
        If a file cannot be read.
    """
    if not files:
        raise RequestError(
            "no file was given. Name the runs' files: seakeep init RUN1.csv RUN2.csv"
        )
    paths = [Path(file) for file in files]
    known = {key: value for key, value in (options or {}).items() if value is not None}
    tables = [read_columns(path, FileSettings.model_validate(known).known()) for path in paths]
    read = arranged(paths, tables, _times(tables))
    guesses = guess_channels(read)
    if not any(guess.channel for guess in guesses):
        _refuse(read)
    loggers = list({file.logger: file for file in reversed(read)}.values())[::-1]
    rates = {file.logger: _rate(file.table, file.time) for file in loggers}
    wave = driving_wave(guesses)
    counted = (
        [] if wave is None else [_wave_period(f, wave) for f in read if f.logger == wave.logger]
    )
    period, hysteresis = counted[0] if counted else (None, 0.0)
    shortest = min((each for each, _ in counted if each is not None), default=None)
    document = tomlkit.document()
    document.add(tomlkit.comment("Draft of a campaign. Read every line that says 'guessed', then"))
    document.add(tomlkit.comment("run: seakeep prepare THIS-FILE, and look at the sheet it makes"))
    _general(document, read, period, hysteresis)
    _files_table(document, read, known)
    _channels(document, guesses)
    names = [guess.channel for guess in guesses if guess.channel]
    document.add(tomlkit.nl())
    for line in derived_examples(names, period, max((r or 0.0) for r in rates.values())):
        document.add(tomlkit.comment(line))
    if read[0].logger:
        _instruments(document, loggers, guesses, rates)
    _runs(document, read, folder)
    kept = [guess for guess in guesses if guess.channel]
    preparation = preparation_table(kept, rates, period, shortest)
    document.add("preparation", preparation)
    holed = [_meant(guess) for guess in guesses if guess.channel is None and guess.gaps]
    holed = [name for name in holed if name not in names]
    document.add("model", model_table(kept, _steps(preparation, rates, period), holed))
    return tomlkit.dumps(document)


def _steps(
    preparation: Table, rates: dict[str, float | None], period: float | None
) -> float | None:
    """Samples a period that the drafted preparation makes, where that is known."""
    if "steps_per_period" in preparation:
        return float(preparation["steps_per_period"])
    rate = preparation.get("sampling_rate") or next(iter(rates.values()))
    return None if rate is None or period is None else float(rate) * period


def _refuse(files: Sequence[File]) -> None:
    first = files[0]
    for other in files[1:]:
        if not set(first.table.names) & set(other.table.names) - {first.time}:
            raise RequestError(
                f"{first.path} and {other.path} have no column in common. Name files of one "
                "logger, one a run; or those of several loggers as RUN/LOGGER.csv or "
                "RUN_LOGGER.csv."
            )
    raise RequestError(
        f"{first.path}: no column has numbers that a channel could be made of (columns: "
        f"{', '.join(first.table.names)}). Check delimiter and decimal mark of the file."
    )


def _times(tables: Sequence[Columns]) -> list[str | None]:
    """Time column of each file, by its name; else by its values, where no file tells its rate."""
    named = [time_column(table) for table in tables]
    return [
        rising_column(table) if time is None and table.sampling_rate is None else time
        for table, time in zip(tables, named, strict=True)
    ]


def _rate(table: Columns, time: str | None) -> float | None:
    step = None if time is None else time_step_of(table, time)
    return table.sampling_rate if step is None else 1.0 / step


def _wave_period(file: File, wave: Guess) -> tuple[float | None, float]:
    """Period of a file's waves, s, and the hysteresis that keeps noise from counting."""
    rate = _rate(file.table, file.time)
    series = file.table.values.get(wave.column, np.zeros(0))
    there = np.isfinite(series)
    if rate is None or there.sum() < LONG or not np.ptp(series[there]) or is_noise(series):
        return None, 0.0
    at = np.arange(series.size)
    series = np.interp(at, at[there], series[there])
    clear = min(np.ceil(100 * NOISE * noise_of(series) / float(series.std())) / 100, 0.5)
    try:
        period = encounter_period(series, 1.0 / rate, clear)
        counted = encounter_period(series, 1.0 / rate)
    except DataError:
        return None, 0.0
    return (period, float(clear)) if counted < LED * period else (counted, 0.0)


def _relative(path: Path, folder: Path | str | None) -> str:
    """Path as the campaign should write it; the data folder, where it is named, by its name."""
    data = os.environ.get("SEAKEEP_DATA_DIR")
    absolute = path.expanduser().resolve()
    if data and absolute.is_relative_to(Path(data).expanduser().resolve()):
        inside = absolute.relative_to(Path(data).expanduser().resolve())
        return "${SEAKEEP_DATA_DIR}/" + inside.as_posix()
    return Path(os.path.relpath(absolute, Path(folder or ".").resolve())).as_posix()


def _general(
    document: tomlkit.TOMLDocument,
    files: Sequence[File],
    period: float | None,
    hysteresis: float,
) -> None:
    general = tomlkit.table()
    common = Path(os.path.commonpath([file.path.resolve().parent for file in files]))
    general.add("name", common.name or "campaign")
    general.add("scale_factor", 1.0)
    general["scale_factor"].comment("full-scale length over model length")
    if period is None:
        general.add(tomlkit.comment("encounter_period = 1.64  # s; STATE IT: no wave was found"))
    else:
        general.add(
            tomlkit.comment(
                f"encounter_period = {period:.3g}  # s; left out, it is measured: the mean of "
                f"{_period_runs(files)} (this is that of {files[0].run})"
            )
        )
    if hysteresis:
        general.add("period_hysteresis", hysteresis)
        general["period_hysteresis"].comment(
            "guessed: what a wave must pass, in standard deviations; less, and noise is counted"
        )
    document.add("campaign", general)
    rig = tomlkit.table()
    rig.add(tomlkit.comment("water_depth = 3.6  # m; 'inf' for deep water"))
    rig.add(tomlkit.comment("[rig.positions]  # channel = x in m along the waves"))
    document.add("rig", rig)


def _period_runs(files: Sequence[File]) -> str:
    irregular = any(waves_of(file.run) == "irregular" for file in files)
    return "the irregular runs" if irregular else "all runs"


def _files_table(
    document: tomlkit.TOMLDocument, files: Sequence[File], known: Mapping[str, object]
) -> None:
    table = tomlkit.table()
    for key, value in known.items():
        table.add(key, value)
    times = {file.time for file in files}
    if len(times) == 1 and (time := files[0].time) is not None:
        table.add("time", time)
        table["time"].comment(_why_time(files[0].table, time))
    elif not files[0].logger and None in times and files[0].table.sampling_rate is None:
        table.add("sampling_rate", 100.0)
        table["sampling_rate"].comment("ASSUMED: the files have no time column. Correct it")
        table.add("sampling_rate_assumed", tomlkit.item(True).comment(REMOVE))
    document.add("files", table)


def _why_time(table: Columns, time: str) -> str:
    if time_column(table) is not None:
        return "guessed from its name"
    unit, step = time_unit_of(table, time), time_step_of(table, time)
    rate = "" if step is None else f": {1 / step:.6g} samples a second"
    return f"guessed: it rises evenly, as times do, in {unit}{rate}. Check it"


def _channels(document: tomlkit.TOMLDocument, guesses: Sequence[Guess]) -> None:
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
        if guess.logger:
            table.add("instrument", guess.logger)
        if guess.named_unit:
            table.add("unit", guess.unit)
            table["unit"].comment("guessed: its name ends on it. Check it")
        elif guess.assumed_unit:
            table.add("unit", guess.unit)
            table["unit"].comment("ASSUMED: the file states none. Correct it")
            table.add("unit_assumed", tomlkit.item(True).comment(REMOVE))
        canonical = canonical_channel(guess.channel)
        if canonical is None:
            table.add("long_name", _label(guess))
        else:
            table["column"].comment(f"guessed: {canonical.long_name}; header '{guess.header}'")
        if guess.gaps:
            table.add(tomlkit.comment("it has gaps: see 'gaps' in [preparation]"))
        channels.add(guess.channel, table)
    document.add("channels", channels)
    if skipped:
        document.add(tomlkit.nl())
    for guess in skipped:
        document.add(tomlkit.comment(f"column '{guess.header}' left out: {guess.why}"))


def _meant(guess: Guess) -> str:
    """Channel that a column would be, were it whole."""
    name, unit = named_unit(guess.column) if guess.named_unit else (guess.column, guess.unit)
    return suggest_channel(name, None if guess.assumed_unit else unit, guess.logger)


def _label(guess: Guess) -> str:
    """Name of a column for labels, without a unit that the campaign converts."""
    return named_unit(guess.column)[0] if guess.named_unit else guess.column


def _instruments(
    document: tomlkit.TOMLDocument,
    loggers: Sequence[File],
    guesses: Sequence[Guess],
    rates: dict[str, float | None],
) -> None:
    """A table a logger; clocks by the trigger, where all have a column that is called like one."""
    triggers = {file.logger: next(filter(is_trigger, file.table.values), None) for file in loggers}
    waves = [g.logger for g in guesses if (g.channel or "").startswith("eta_")]
    reference = (waves or [file.logger for file in loggers])[0]
    instruments = tomlkit.table()
    instruments.add("reference", reference)
    instruments["reference"].comment("guessed: its clock is the time of all")
    if not all(triggers.values()):
        for line in (
            "no trigger was found in all files: clocks are taken as they are. If they are not",
            "synchronous, state in [instruments.NAME] shared = ['OWN COLUMN', \"REFERENCE'S\"] of",
            "one signal both record, correlated = [...] of two that go together, or offset (s)",
        ):
            instruments.add(tomlkit.comment(line))
    stated = len({file.time for file in loggers}) > 1
    for file in loggers:
        table = tomlkit.table()
        if stated and file.time is not None:
            table.add("time", file.time)
        if file.time is None and file.table.sampling_rate is None:
            table.add("sampling_rate", 100.0)
            table["sampling_rate"].comment("ASSUMED: the file has no time column. Correct it")
            table.add("sampling_rate_assumed", tomlkit.item(True).comment(REMOVE))
        elif rate := rates[file.logger]:
            table.add(tomlkit.comment(f"{rate:.6g} samples a second"))
        if all(triggers.values()):
            table.add("trigger", triggers[file.logger])
            table["trigger"].comment("guessed: pulses that all loggers recorded")
        instruments.add(file.logger, table)
    document.add("instruments", instruments)


def _runs(document: tomlkit.TOMLDocument, files: Sequence[File], folder: Path | str | None) -> None:
    runs = tomlkit.table(is_super_table=True)
    names = list(dict.fromkeys(file.run for file in files))
    loggers = {file.logger for file in files}
    irregular = [name for name in names if waves_of(name) != "regular"]
    order = irregular if len(irregular) > 1 else names
    which = "irregular runs but the last train, the rest tests"
    which = which if len(order) < len(names) else "the first runs train, the last one tests"
    for name in names:
        table = tomlkit.table()
        own = {file.logger: _relative(file.path, folder) for file in files if file.run == name}
        if set(own) == {""}:
            table.add("file", own[""])
        if waves := waves_of(name):
            table.add("waves", waves)
            table["waves"].comment("guessed from its name; irregular runs give the period")
        if len(names) == 1:
            table.add(tomlkit.comment("train = [0.0, 60.0]  # s; with test = [60.0, inf]"))
        if missing := sorted(loggers - set(own)):
            table.add("role", "unused")
            table["role"].comment(f"it has no file of {', '.join(missing)}")
        else:
            last = name == order[-1] and len(order) > 1
            table.add("role", "test" if last or name not in order else "train")
            table["role"].comment(f"guessed: {which}" if len(names) > 1 else "the only run")
        table.add(tomlkit.comment("span = [10.0, inf]  # s; cut the start-up of the waves off"))
        if set(own) != {""}:
            table.add("files", _file_table(own))
        runs.add(name, table)
    document.add("runs", runs)


def _file_table(own: dict[str, str]) -> Table:
    table = tomlkit.table()
    for logger, path in own.items():
        table.add(logger, path)
    return table
