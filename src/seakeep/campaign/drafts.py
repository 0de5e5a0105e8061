"""A draft campaign file, guessed from the files of its runs, as ``seakeep init`` writes it."""

import math
import os
from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from seakeep.campaign.datasets import data_folder
from seakeep.campaign.guesses import (
    HYSTERESIS,
    SHORT_GAP,
    Files,
    Guess,
    Guesses,
    Seas,
    arranged,
    dead_motions,
    guess_channels,
    is_trigger,
    misplaced,
    placings,
    seas_of,
    waves_of_name,
)
from seakeep.campaign.settings import FileSettings
from seakeep.conventions import MOTIONS, is_elevation
from seakeep.errors import RequestError
from seakeep.files import MARK, expanded
from seakeep.formats import read_columns
from seakeep.toml import rendered, validated

STEPS = 32
"""Samples per period that the paper takes, and a draft proposes."""


def draft_campaign(
    files: Sequence[Path | str],
    folder: Path | str | None = None,
    options: Mapping[str, object] | None = None,
) -> str:
    """Draft a campaign file from the files of its runs.

    Parameters
    ----------
    files : sequence of Path or str
        Files of one campaign: one per run, all with the same columns; or one per logger and run,
        named ``RUN/LOGGER.csv`` or ``RUN_LOGGER.csv``. A run whose waves lie within those of the
        others is proposed for testing.
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
    if not len(files):
        raise RequestError(
            "no file was given. Name the runs' files: seakeep init RUN1.csv RUN2.csv"
        )
    paths = [Path(file) for file in files]
    known = {key: value for key, value in (options or {}).items() if value is not None}
    settings = validated(FileSettings, known, "options", "draft")
    read = arranged(paths, [read_columns(path, settings) for path in paths])
    guesses = guess_channels(read)
    if not any(guess.channel for guess in guesses):
        first = read[0]
        by_folder, by_name = placings(read)
        placed = by_folder if len({file.run for file in by_folder}) > 1 else by_name
        shared = set(first.table.names) - {first.time}
        lone = ((placed[0], file) for file in placed[1:] if not shared & set(file.table.names))
        damaged = any(file.table.faults for file in read)  # which explains it
        for one, other in () if damaged else chain(misplaced(placed), lone):
            why = "have no column in common"
            if one.run == other.run:
                why = "are of one run and have the same columns: leave one out"
            elif one.logger == other.logger:
                why = (
                    "are called as those of one logger and differ in their columns: draft without "
                    "the odd one, then state it as a logger of its own ([runs.NAME.files], and its "
                    "columns in [runs.NAME.channels])"
                )
            raise RequestError(
                f"{one.path} and {other.path} {why}. Name files of one logger, one per run; or "
                "those of several loggers as RUN/LOGGER.csv or RUN_LOGGER.csv."
            )
        mend = "Check delimiter and decimal mark of the file."
        raise RequestError(
            f"{first.path}: no column has numbers that a channel could be made of (columns: "
            f"{', '.join(first.table.names)}). {next(iter(first.table.faults.values()), mend)}"
        )
    wave = next(iter(_inputs(guesses)), None)
    seas, odd = seas_of(read, guesses, wave) if wave else ({}, {})
    runs = list(dict.fromkeys(file.run for file in read))
    named = {run: kind for run in runs if (kind := waves_of_name(run))}
    kinds = {run: "regular" if sea.regular else "irregular" for run, sea in seas.items()} | named
    known_rates = [(f.rate, f.logger) for f in read if f.rate and math.isfinite(f.rate)]
    rates = [rate for rate, _ in known_rates]
    moving = {g.logger for g in guesses if g.is_motion or g.is_range or is_elevation(g.channel)}
    own = (rate for rate, logger in known_rates if logger in moving)
    slowest = min(own, default=min(rates, default=25.0))
    units = {file.time_unit for file in read}
    shortest = min((sea.period for sea in seas.values()), default=0.0)
    return rendered(
        "campaign",
        "draft.toml",
        mark=f"{MARK}: draft",
        name=Path(os.path.commonpath([file.path.resolve().parent for file in read])).name
        or "campaign",
        options=known,
        first=read[0],
        times={file.time for file in read},
        seas=seas,
        some_irregular=any(kinds[run] == "irregular" for run in seas),
        noisy=any(sea.noisy for sea in seas.values()),
        groups=[sea.group for sea in seas.values()],
        wave=wave,
        kinds=kinds,
        named_kinds=named,
        roles=_roles(read, guesses, seas, kinds, odd),
        paths_of={
            run: {file.logger: _relative(file.path, folder) for file in read if file.run == run}
            for run in runs
        },
        hysteresis=HYSTERESIS,
        steps=STEPS,
        short_gap=SHORT_GAP,
        rates=rates,
        in_ms={f.run for f in read if f.time_unit == "ms"} if len(units) > 1 else (),
        slowest=slowest,
        moving=moving,
        shortest=shortest,
        # One step for all, no finer than that of the fastest logger.
        every=int(max(rates, default=0.0) * shortest / STEPS),
        **_loggers(read, guesses),
        **_channels(guesses),
    )


def _loggers(files: Files, guesses: Guesses) -> dict[str, Any]:
    """One file of each logger; clocks by the trigger, where all loggers have one."""
    if not files[0].logger:
        return {"loggers": []}
    loggers = list({file.logger: file for file in reversed(files)}.values())[::-1]
    triggers = {file.logger: next(filter(is_trigger, file.table.values), None) for file in loggers}
    waves = (guess.logger for guess in guesses if is_elevation(guess.channel))
    return {
        "loggers": loggers,
        "times_of_loggers": {file.time for file in loggers},
        "triggers": triggers if all(triggers.values()) else {},
        "reference": next(waves, loggers[0].logger),
    }


def _roles(
    files: Files,
    guesses: Guesses,
    seas: Seas,
    kinds: Mapping[str, str],
    odd: Mapping[str, float],
) -> dict[str, tuple[str, str]]:
    """Role of each run, and why: irregular runs train, and one whose waves lie within theirs tests.

    Runs without waves are not used, where others have some; nor are those that lack a file, whose
    scale is an odd one, or in which a motion that others show is constant.
    """
    runs, loggers = dict.fromkeys(file.run for file in files), {file.logger for file in files}
    dead = dead_motions(files, guesses) if len(runs) > 1 else {}
    roles, whole = {}, []
    for name in runs:
        why = (
            "guessed: no waves were found, as in still water, decay tests or by a dead probe. With "
            "waves = 'still' and role = 'test' check judges a decay"
        )
        if lacking := loggers - {file.logger for file in files if file.run == name}:
            why = f"it has no file of {', '.join(sorted(lacking))}"
        elif name in odd:
            why = (
                f"guessed: its waves are {odd[name]:.3g} times those of the others (median), and "
                "as steep: is it of another scale?"
            )
        elif name in dead:
            why = f"guessed: {dead[name]} is constant, and moves in other runs: a dead sensor?"
        else:
            whole.append(name)
        roles[name] = "unused", why
    if len(whole) == 1:
        return roles | {whole[0]: ("train", "the only run")}
    moved = [name for name in whole if name in seas or not seas]
    irregular = [name for name in moved if kinds.get(name) != "regular"]
    mixed = 0 < len(irregular) < len(moved)
    order = irregular if mixed else moved
    tests, which = _tests_of(order, seas) if len(order) > 1 else ([], "")
    why = f"guessed: {which} tests, these train" if tests else "the only run to train on"
    if mixed:
        why = "guessed: irregular runs train" + (" but one, the rest tests" if tests else "")
    return roles | {
        name: ("train" if name in order and name not in tests else "test", why) for name in moved
    }


def _tests_of(names: Sequence[str], seas: Seas) -> tuple[list[str], str]:
    """A run whose waves lie within the range of the others', or nearest, and its repeats; in words.

    Of several regular waves, that with the least distance to the next one in period.
    """
    groups = defaultdict(list)
    for name in names if seas else ():
        groups[seas[name].group].append(name)
    if len(groups) < 2:
        return [names[-1]], "the last run"

    def distance(group: list[str]) -> tuple[float, int, float]:
        own, others = seas[group[0]], [seas[name] for name in names if name not in group]
        outside = 0.0
        for key in ("height", "period"):
            value, rest = getattr(own, key), [getattr(sea, key) for sea in others]
            outside += math.log(max(min(rest) / value, value / max(rest), 1.0))
        nearest = min(abs(math.log(sea.period / own.period)) for sea in others)
        return outside, len(group), nearest if own.regular else -names.index(group[0])

    best = min(groups.values(), key=distance)
    if distance(best)[0] > 0:
        return best, "no waves lie within those of the others; the nearest run"
    return best, "one run whose waves lie within those of the others"


def _relative(path: Path, folder: Path | str | None) -> str:
    """Path as the campaign should write it; the data folder, where it is named, by its name."""
    data = data_folder()
    absolute = expanded(path).resolve()
    if data and absolute.is_relative_to(data.resolve()):
        return "${SEAKEEP_DATA_DIR}/" + absolute.relative_to(data.resolve()).as_posix()
    return Path(os.path.relpath(absolute, Path(folder or ".").resolve())).as_posix()


def _inputs(guesses: Guesses) -> list[Guess]:
    """Wave probes that drive a model: none that is behind the vessel, is dead or has more gaps."""
    waves = [guess for guess in guesses if is_elevation(guess.channel)]
    before = [guess for guess in waves if not (guess.behind or guess.at_rest)] or waves
    least = min((guess.gaps for guess in before), key=("", "short", "long").index, default="long")
    return [guess for guess in before if guess.gaps == least]


def _channels(guesses: Guesses) -> dict[str, Any]:
    """Channels: motions as states, waves as inputs, and what is to be said of the others."""
    mapped = {guess.channel: guess for guess in guesses if guess.channel}
    kinds = [[m + kind for m in MOTIONS] for kind in ("", "_rate", "_acceleration")]
    usable = [n for n, g in mapped.items() if g.gaps != "long" and not g.at_rest]
    moved = [[name for name in usable if name in kind] for kind in kinds]
    rest = [name for name in usable if not is_elevation(name, rates=True)]
    states = [*moved[0], *moved[1]] or moved[2] or rest or list(mapped)[:1]
    inputs = [guess.channel for guess in _inputs(guesses) if guess.channel not in states]
    motions = [name for name in mapped if any(name in kind for kind in kinds)]
    probes = [name for name in mapped if is_elevation(name) and name not in inputs]
    behind = [name for name in probes if mapped[name].behind]
    return {
        "mapped": mapped,
        "skipped": [guess for guess in guesses if not guess.channel],
        "gaps": {name: guess.gaps for name, guess in mapped.items() if guess.gaps},
        "states": states,
        "moved": any(moved),
        "headed": not all(guess.column.isdigit() for guess in guesses),
        "still": [name for name in (*motions, *probes) if mapped[name].at_rest],
        "gapped_motions": [name for name in motions if mapped[name].gaps == "long"],
        "loads": [n for n in rest if n.startswith("mooring_") and n not in states],
        "inputs": inputs,
        "behind": behind,
        "gapped_probes": [n for n in probes if mapped[n].gaps and n not in behind],
    }
