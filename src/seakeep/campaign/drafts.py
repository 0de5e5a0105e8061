"""A draft campaign file, guessed from the files of its runs, as ``seakeep init`` writes it."""

import math
import os
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import tomlkit

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
    seas_of,
    waves_of_name,
)
from seakeep.campaign.readers import time_column, time_step_of, time_unit_of
from seakeep.campaign.settings import FileSettings
from seakeep.conventions import MOTIONS, canonical_channel, is_elevation
from seakeep.errors import RequestError
from seakeep.files import MARK, expanded
from seakeep.formats import read_columns
from seakeep.formats.columns import named_unit
from seakeep.toml import validated

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
        _refuse(read)
    wave = next(iter(_inputs(guesses)), None)
    seas = seas_of(read, guesses, wave) if wave else {}
    parts = [
        f"# Draft of a campaign ({MARK}: draft). Read every line that says 'guessed', then\n"
        "# run: seakeep prepare THIS-FILE, and look at the sheet it makes",
        _general(read, seas, wave),
        *_files(read, known),
        *_channels(guesses),
        *(_instruments(read, guesses) if read[0].logger else ()),
        *_runs(read, _roles(read, guesses, seas), seas, folder),
        *_preparation(read, guesses, seas),
        *_model(guesses),
    ]
    return "\n".join(parts) + "\n"


def _value(value: object) -> str:
    """A value as TOML writes it."""
    return tomlkit.item(value).as_string()


def _key(name: str) -> str:
    return tomlkit.key(name).as_string()


def _refuse(files: Files) -> None:
    first = files[0]
    for other in files[1:]:
        if not set(first.table.names) & set(other.table.names) - {first.time}:
            raise RequestError(
                f"{first.path} and {other.path} have no column in common. Name files of one "
                "logger, one per run; or those of several loggers as RUN/LOGGER.csv or "
                "RUN_LOGGER.csv."
            )
    raise RequestError(
        f"{first.path}: no column has numbers that a channel could be made of (columns: "
        f"{', '.join(first.table.names)}). Check delimiter and decimal mark of the file."
    )


def _general(files: Files, seas: Seas, wave: Guess | None) -> str:
    common = Path(os.path.commonpath([file.path.resolve().parent for file in files]))
    period = "# encounter_period = …  # s; STATE IT: no wave was found"
    if seas:
        run, sea = next(iter(seas.items()))
        some = "irregular" in {_kind(each, seas) for each in seas}
        period = (
            f"# encounter_period = {sea.period:.3g}  # s; left out, it is measured: the mean of "
            f"{'the irregular runs' if some else 'all runs'} (this is that of {run})"
        )
    if wave and any(sea.noisy for sea in seas.values()):
        said = f"guessed: without it, noise of {wave.channel} counts as waves"
        period += f"\nperiod_hysteresis = {HYSTERESIS} # {said}"
    return f"""
[campaign]
name = {_value(common.name or "campaign")}
scale_factor = 1.0 # full-scale length over model length
{period}

[rig]
# water_depth = …  # m, or inf for deep water; needed where probes are aligned
# [rig.positions]  # channel = x in m along the waves"""


def _assumed_rate(files: str) -> str:
    return (
        f"sampling_rate = 100.0 # ASSUMED: {files} no time column. Correct it\n"
        "sampling_rate_assumed = true # prepare warns of it: remove it"
    )


def _files(files: Files, known: Mapping[str, object]) -> Iterator[str]:
    yield from ("", "[files]", *(f"{key} = {_value(value)}" for key, value in known.items()))
    first, times = files[0], {file.time for file in files}
    if first.time and len(times) == 1:
        why = "guessed from its name"
        if time_column(first.table) is None:
            unit, step = (of(first.table, first.time) for of in (time_unit_of, time_step_of))
            rate = "" if step is None else f": {1 / float(step):.6g} samples per second"
            why = f"guessed: it rises evenly, as times do, in {unit}{rate}. Check it"
        yield f"time = {_value(first.time)} # {why}"
    elif not first.logger and "" in times and first.table.sampling_rate is None:
        yield _assumed_rate("the files have")


def _channels(guesses: Guesses) -> Iterator[str]:
    yield "\n# A channel is sign * (reading + offset), converted to SI."
    for guess in guesses:
        if not guess.channel:
            continue
        canonical = canonical_channel(guess.channel)
        said = "NOT RECOGNISED: rename the channel if it is a motion or load"
        if canonical:
            said = f"guessed: {canonical.long_name}"
        yield f"\n[channels.{guess.channel}]"
        yield f"column = {_value(guess.column)} # {said}; header '{guess.header}'"
        if guess.logger:
            yield f"instrument = {_value(guess.logger)}"
        if guess.unit_from == "name":
            yield f"unit = {_value(guess.unit)} # guessed: its name ends on it. Check it"
        elif guess.unit_from == "nobody":
            yield f"unit = {_value(guess.unit)} # ASSUMED: the file states none. Correct it"
            yield "unit_assumed = true # prepare warns of it: remove it"
        if canonical is None:  # without a unit that the campaign converts
            named = guess.unit_from == "name"
            yield f"long_name = {_value(named_unit(guess.column)[0] if named else guess.column)}"
        if guess.gaps:
            yield "# it has gaps: see 'gaps' in [preparation]"
    skipped = [guess for guess in guesses if not guess.channel]
    yield from [""] * bool(skipped)
    yield from (f"# column '{guess.header}' left out: {guess.why}" for guess in skipped)


def _instruments(files: Files, guesses: Guesses) -> Iterator[str]:
    """A table per logger; clocks by the trigger, where all loggers have one."""
    loggers = list({file.logger: file for file in reversed(files)}.values())[::-1]
    triggers = {file.logger: next(filter(is_trigger, file.table.values), None) for file in loggers}
    waves = [g.logger for g in guesses if is_elevation(g.channel)]
    reference = (waves or list(triggers))[0]
    yield "\n[instruments]"
    yield f"reference = {_value(reference)} # guessed: its clock is the time of all"
    if not all(triggers.values()):
        yield """# no trigger was found in all files: clocks are taken as they are. If they differ,
# state in [instruments.NAME] shared = ['OWN COLUMN', "REFERENCE'S"] of one signal
# that both record, correlated = [...] of two that go together, or offset (s)"""
    stated = len({file.time for file in loggers}) > 1
    for file in loggers:
        yield f"\n[instruments.{_key(file.logger)}]"
        if stated and file.time:
            yield f"time = {_value(file.time)}"
        if file.rate:
            yield f"# {file.rate:.6g} samples per second"
        elif not file.time:
            yield _assumed_rate("the file has")
        if all(triggers.values()):
            name = _value(triggers[file.logger])
            yield f"trigger = {name} # guessed: pulses that all loggers recorded"


def _runs(
    files: Files,
    roles: Mapping[str, tuple[str, str]],
    seas: Seas,
    folder: Path | str | None,
) -> Iterator[str]:
    groups = [sea.group for sea in seas.values()]
    for name, (role, why) in roles.items():
        own = {file.logger: _relative(file.path, folder) for file in files if file.run == name}
        is_first, sea = name == files[0].run, seas.get(name)
        yield f"\n[runs.{_key(name)}]"
        if "" in own:
            yield f"file = {_value(own.pop(''))}"
        if kind := _kind(name, seas):
            source = "name" if waves_of_name(name) else "spectrum"
            yield f"waves = {_value(kind)} # guessed from its {source}"
        yield f"role = {_value(role)} # {why}"
        if len(roles) == 1:
            yield "# train = [0.0, 60.0]  # s; in place of role, with test = [60.0, inf]"
        # Training keeps the onset, since steady waves hold one frequency.
        if sea and sea.start > 0 and role == "test":
            yield f"span = [{sea.start:.2f}, inf] # s; guessed: the waves have come to the vessel"
        elif is_first:
            yield "# span = [10.0, inf]  # s; cut the start-up of the waves off"
        if sea and groups.count(sea.group) > 1:
            group = _value(f"waves of {sea.group}")
            yield f"sea_state = {group} # guessed: the same waves come again"
        elif is_first:
            yield "# sea_state = 'A'  # one word for runs in one sea, which studies judge together"
        if own:
            yield f"\n[runs.{_key(name)}.files]"
            yield from (f"{_key(logger)} = {_value(path)}" for logger, path in own.items())


def _kind(run: str, seas: Seas) -> str | None:
    """Kind of a run's waves, by its name or else by their spectrum; None if neither says."""
    if (named := waves_of_name(run)) or run not in seas:
        return named
    return "regular" if seas[run].regular else "irregular"


def _roles(files: Files, guesses: Guesses, seas: Seas) -> dict[str, tuple[str, str]]:
    """Role of each run, and why: irregular runs train, and one whose waves lie within theirs tests.

    Runs without waves are not used, where others have some; nor are those that lack a file, or in
    which a motion that others show is constant.
    """
    runs, loggers = dict.fromkeys(file.run for file in files), {file.logger for file in files}
    dead = dead_motions(files, guesses) if len(runs) > 1 else {}
    roles, whole = {}, []
    for name in runs:
        why = "guessed: no waves were found, as in still water or decay tests"
        roles[name] = (
            "unused",
            f"{why}. With waves = 'still' and role = 'test' check judges a decay",
        )
        lacking = loggers - {file.logger for file in files if file.run == name}
        if lacking:
            roles[name] = "unused", f"it has no file of {', '.join(sorted(lacking))}"
        elif name in dead:
            why = f"guessed: {dead[name]} is constant, and moves in other runs: a dead sensor?"
            roles[name] = "unused", why
        else:
            whole.append(name)
    if len(whole) == 1:
        return roles | {whole[0]: ("train", "the only run")}
    moved = [name for name in whole if name in seas or not seas]
    irregular = [name for name in moved if _kind(name, seas) != "regular"]
    mixed = 0 < len(irregular) < len(moved)
    order = irregular if mixed else moved
    tests, which = _tests_of(order, seas) if len(order) > 1 else ([], "")
    why = f"guessed: {which} tests, these train" if tests else "the only run to train on"
    if mixed:
        why = "guessed: irregular runs train" + (" but one, the rest tests" if tests else "")
    trains = [name for name in order if name not in tests]
    return roles | {n: ("train" if n in trains else "test", why) for n in moved}


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


def _preparation(files: Files, guesses: Guesses, seas: Seas) -> Iterator[str]:
    """One step for all, no finer than that of the fastest logger, and what to do about gaps."""
    yield "\n[preparation]"
    several = bool(files[0].logger)
    rates = [file.rate for file in files if file.rate and math.isfinite(file.rate)]
    shortest = min((sea.period for sea in seas.values()), default=0.0)
    every = int(max(rates, default=0.0) * shortest / STEPS)
    if rates and not several:
        hint = ". Are times in ms? Then state time_unit = 'ms' in [files], or correct the header"
        yield f"# the files have {min(rates):.6g} samples per second{hint * (min(rates) < 1)}"
    if every > 1:
        yield (
            f"sampling_rate = {max(rates) / every:#.6g} # Hz; guessed: about {STEPS} samples per "
            f"wave of {shortest:.3g} s, the shortest"
        )
    elif several:
        rate = min(rates, default=25.0)
        yield f"sampling_rate = {rate:#.6g} # Hz; guessed: that of the slowest logger"
    else:
        yield f"# sampling_rate = {min([25.0, *rates]):.6g}  # Hz; left out, the files' own"
    if gapped := {guess.channel: guess.gaps for guess in guesses if guess.channel and guess.gaps}:
        yield (
            f'gaps = "{"bridge" if "short" in gapped.values() else "mask"}" # '
            f"{', '.join(gapped)}: 'mask' flags gaps, 'bridge' fills those up to {SHORT_GAP} s "
            "and says so"
        )


def _inputs(guesses: Guesses) -> list[Guess]:
    """Wave probes that drive a model: none behind the vessel, without gaps where there are such."""
    waves = [guess for guess in guesses if is_elevation(guess.channel)]
    before = [guess for guess in waves if not guess.behind] or waves
    least = min((guess.gaps for guess in before), key=("", "short", "long").index, default="long")
    return [guess for guess in before if guess.gaps == least]


def _model(guesses: Guesses) -> Iterator[str]:
    """Motions as states, waves as inputs, delays in encounter periods."""
    mapped = {guess.channel: guess for guess in guesses if guess.channel}
    kinds = [[m + kind for m in MOTIONS] for kind in ("", "_rate", "_acceleration")]
    usable = [n for n, g in mapped.items() if g.gaps != "long" and not g.at_rest]
    moved = [[name for name in usable if name in kind] for kind in kinds]
    rest = [name for name in usable if not is_elevation(name, rates=True)]
    states = [*moved[0], *moved[1]] or moved[2] or rest or list(mapped)[:1]
    inputs = [guess.channel for guess in _inputs(guesses) if guess.channel not in states]
    motions = [name for name in mapped if any(name in kind for kind in kinds)]
    loads = [n for n in rest if n.startswith("mooring_") and n not in states]
    probes = [name for name in mapped if is_elevation(name) and name not in inputs]
    behind = [name for name in probes if mapped[name].behind]
    said = "guessed: the motions that the model forecasts"
    if not any(moved):
        said = "CORRECT IT: no motion was found; name the files of all loggers to init"
        if all(guess.column.isdigit() for guess in guesses):
            said = (
                "CORRECT IT: the files have no header; give [channels.…] their names, such as "
                "heave or eta_1, and state units"
            )
    yield f'\n[model]\npreset = "recommended"\nstates = {_value(states)} # {said}'
    if still := [name for name in motions if mapped[name].at_rest]:
        yield f"# {', '.join(still)} left out: next to no motion beside the others: restrained?"
    yield from _gapped([name for name in motions if mapped[name].gaps == "long"], "states")
    if loads:
        yield f"""# Loads ({", ".join(loads)}) may be added to the states: they are read off the
# motions where a line goes slack and that is better. Judge their extremes."""
    said = "guessed: the waves that drive it"
    if not inputs:
        said = "CORRECT IT: no name tells the waves; without inputs nothing drives the model"
    yield f"""inputs = {_value(inputs)} # {said}
# kind = 'bayesian_hankel_dmdc' # an ensemble: its forecasts have a band"""
    if behind:
        yield f"# {', '.join(behind)} left out: behind the vessel, by name, where its own waves are"
    else:
        yield "# Remove probes that stand behind the vessel: the waves it makes are not an input."
    yield from _gapped([n for n in probes if mapped[n].gaps and n not in behind], "inputs")


def _gapped(names: Sequence[str], key: str) -> Iterator[str]:
    """What to do about channels left out for their gaps, if there are any."""
    if names:
        has = "it has" if len(names) == 1 else "they have"
        yield (
            f"# {', '.join(names)} left out: {has} gaps, and a model takes none. To be among the "
            f"{key}, repair them in the files, or bridge them (gaps, longest_gap in [preparation])."
        )
