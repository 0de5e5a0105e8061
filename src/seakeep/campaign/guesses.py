"""Guesses about columns, files and runs of a campaign, from names, units and waves."""

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, product
from pathlib import Path
from typing import Literal

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.campaign.readers import (
    CALLED,
    from_midnight,
    kinds_of,
    motions_of,
    time_column,
    time_step_of,
    time_unit_of,
    words_of,
)
from seakeep.campaign.settings import FileSettings
from seakeep.conventions import (
    MOTIONS,
    Channel,
    canonical_channel,
    conversion,
    is_elevation,
    same_unit,
    si_unit,
)
from seakeep.errors import DataError
from seakeep.formats import Columns
from seakeep.formats.columns import is_unit, named_unit
from seakeep.quality.faults import noise_share
from seakeep.signals import encounter_period, repeated_waves, uniform_step, waves_part
from seakeep.signals.time_axis import over_gaps, past_midnight, stretches
from seakeep.signals.waves import energy_period, first_wave, is_regular

LONG = 64
"""Samples that a column must have for its waves or its step to be judged."""

SERIAL = 2e-5
"""Step of times of no unit below which they are days: as seconds they would be of 50 kHz."""

USABLE = 0.9
"""Part of a column that must be numbers for it to become a channel with gaps."""

STILL = 0.05
"""Part of the highest run's waves below which a run has none."""

AS_STEEP = 5.0
"""Factor between the steepnesses (height per squared period) of two scales of one campaign; what a
decay radiates is less steep than waves by more, at like periods."""

SHORT_GAP = 0.25
"""Seconds: what ``gaps = "bridge"`` fills unless ``longest_gap`` says otherwise."""

AT_REST = 0.05
"""Part of the largest motion or wave of its unit below which one is restrained, or its sensor dead;
head seas leave 0.02."""

HYSTERESIS = 0.3
"""Standard deviations that a wave must pass where noise leads the count."""


@dataclass(frozen=True, eq=False)
class File:
    """A file of a run: its columns, that which is time, and of which run and which logger it is."""

    path: Path
    table: Columns
    time: str
    run: str = ""
    logger: str = ""

    def is_like(self, other: "File") -> bool:
        """Whether it has columns of the same names, as other files of its logger have."""
        own, others = (
            {n for n in each.table.names if n != each.time and not is_trigger(n)}
            for each in (self, other)
        )
        return len(own & others) >= 0.5 * min(len(own), len(others))

    @property
    def rate(self) -> float | None:
        """Samples per second, where the file states them."""
        step = time_step_of(self.table, self.time)
        return 1.0 / step if step else self.table.sampling_rate

    @property
    def time_unit(self) -> str:
        """Unit of the times."""
        return time_unit_of(self.table, self.time)

    @property
    def time_is_named(self) -> bool:
        """Whether a column has a usual name of times."""
        return time_column(self.table) is not None

    @property
    def start(self) -> float:
        """First instant, s; zero where the file states none."""
        times, unit = self.table.values.get(self.time, np.zeros(1)), self.time_unit
        factor = conversion(unit, "s") if is_unit(unit) else 1.0
        return factor * times[0] if np.isfinite(times[0]) else 0.0

    def series(self, column: str) -> FloatArray:
        """A column without its gaps; empty where there is too little of it, or it is constant."""
        series = self.table.values.get(column, np.zeros(0))
        there = np.isfinite(series)
        if not self.rate or there.sum() < LONG or not np.ptp(series[there]):
            return np.zeros(0)
        return over_gaps(series)


@dataclass(frozen=True)
class Guess:
    """A guess for a column; `channel` is empty where nothing fits, and `why` says so.

    `unit_from` says who states the unit: all files, some, the end of the column's name, or nobody.
    `at_rest` says that the motion or the wave does not show beside others, `behind` that a probe's
    name places it behind the vessel.
    """

    column: str
    header: str
    unit: str
    unit_from: Literal["files", "some", "name", "nobody"]
    channel: str = ""
    logger: str = ""
    why: str = ""
    gaps: Literal["", "short", "long"] = ""
    at_rest: bool = False
    behind: bool = False

    @property
    def canonical(self) -> Channel | None:
        """The canonical channel, if it is one."""
        return canonical_channel(self.channel)

    @property
    def name(self) -> str:
        """Name of the column, without a unit that it ends on."""
        return named_unit(self.column)[0] if self.unit_from == "name" else self.column

    @property
    def is_motion(self) -> bool:
        """Whether it is a motion, a rate or an acceleration of the body."""
        return self.channel.partition("_")[0] in MOTIONS

    @property
    def is_range(self) -> bool:
        """Whether it is a length that its name calls a range, such as to the waves."""
        length = is_unit(self.unit) and si_unit(self.unit) == "m"
        return length and "range" in kinds_of(self.column)

    @property
    def counts_down(self) -> bool:
        """Whether it is a heave, its rate or acceleration, whose name says that it counts down."""
        return self.channel.startswith("heave") and "down" in words_of(self.column)


@dataclass(frozen=True)
class Sea:
    """Waves of a run: standard deviation in the file's unit, mean period in s, and their kind.

    `noisy` says that noise of the probe leads the count of waves, `start` when the waves have come
    to all probes and to the vessel (s, on the run's clock), `group` the first run of these waves.
    """

    height: float
    period: float
    regular: bool
    noisy: bool
    start: float
    group: str


Files = Sequence[File]
Guesses = Sequence[Guess]
Seas = Mapping[str, Sea]
"""By run."""


@np.errstate(over="ignore", invalid="ignore")
def seas_of(files: Files, guesses: Guesses, wave: Guess) -> tuple[dict[str, Sea], dict[str, float]]:
    """Waves, as one probe recorded them, of each run that has some; decay tests have none.

    A run of another scale is left out, so that the others are not still water beside it: how many
    times the median of the others its waves are is the second result.
    """
    series = {f: f.series(wave.column) for f in files if f.logger == wave.logger}
    seas = {f: sea for f, x in series.items() if x.size and (sea := _sea(f, x))}
    falling = sorted(seas.values(), key=lambda sea: -sea.height)
    odd = {}
    if len(falling) > 2:  # of two, none is the odd one
        first, second, *_ = falling
        alike = first.height / first.period**2 < AS_STEEP * second.height / second.period**2
        if alike and second.height <= STILL * first.height:
            odd[first.group] = first.height / float(np.median([s.height for s in falling[1:]]))
    highest = falling[len(odd)].height if falling else 0.0
    seas = {f: s for f, s in seas.items() if STILL * highest < s.height <= highest}
    rate = min((file.rate or 1.0 for file in seas), default=1.0)
    records = {}
    for file in seas:
        x, own = series[file], file.rate or 1.0
        records[file.run] = np.interp(np.arange(0, x.size, own / rate), np.arange(x.size), x)
    groups = repeated_waves(records, 1.0 / rate)
    return {
        file.run: replace(sea, group=groups[file.run], start=_start(file.run, files, guesses))
        for file, sea in seas.items()
    }, odd


def _sea(file: File, series: FloatArray) -> Sea | None:
    step = 1.0 / (file.rate or 1.0)
    try:
        if noise_share(series) > 0.5:
            return None
        series = series[waves_part(series, step)]
        regular = is_regular(series)
        period = encounter_period(series, step)
        if noisy := period < energy_period(series, step) * (0.8 if regular else 0.5):
            period = encounter_period(series, step, HYSTERESIS)
    except DataError:
        return None
    return Sea(series.std(), period, regular, noisy, 0.0, file.run)


def _start(run: str, files: Files, guesses: Guesses) -> float:
    """Latest instant at which the waves have come to a probe, or a motion has begun."""
    starts = [0.0]
    for file, guess in product(files, guesses):
        name = guess.channel
        if file.run != run or file.logger != guess.logger:
            continue
        series = file.series(guess.column)
        if not series.size or not (is_elevation(name, rates=True) or name in MOTIONS):
            continue
        if begin := first_wave(series, name in MOTIONS):
            starts.append(1.0 / (file.rate or 1.0) * begin + file.start)
    return max(starts)


def waves_of_name(run: str) -> str | None:
    """Say "regular" or "irregular" if the name of a run does."""
    return next((kind for kind in ("irregular", "regular") if kind in kinds_of(run)), None)


def is_trigger(column: str) -> bool:
    """Whether a column may hold the pulses that all loggers recorded."""
    return "trigger" in kinds_of(column)


def _plain(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9_+-]+", "_", text).strip("_+-") or "run"


def _stem(path: Path) -> str:
    return _plain(path.name.split(".")[0])


def _by_folder(path: Path) -> tuple[str, str]:
    folder = _plain(path.resolve().parent.name)
    return folder, _stem(path).removeprefix(folder).strip("_+-") or _stem(path)


def _by_name(files: Files) -> list[tuple[str, str]]:
    """Run and logger, where files of like columns end on the same words."""
    stems = [re.split(r"[_-]+", _stem(file.path)) for file in files]
    keys = []
    for file, words in zip(files, stems, strict=True):
        alike = [s for s, other in zip(stems, files, strict=True) if file.is_like(other)]
        count = 0
        while count < len(words) and len({tuple(s[-count - 1 :]) for s in alike}) == 1:
            count += 1
        at = len(words) - (count if len(alike) > 1 else 1)
        keys.append(("_".join(words[:at]), "_".join(words[at:])))
    return keys


def arranged(paths: Sequence[Path], tables: Sequence[Columns]) -> list[File]:
    """Find out which file belongs to which run and logger.

    Files are of several loggers where those of one run have different columns, and those of one
    logger the same: ``RUN/LOGGER.csv`` or ``RUN_LOGGER.csv``. Otherwise each file is a run, called
    as its folder where the files are called alike.
    """
    # Times by their name; else by their values, where the file does not state its rate.
    files = [
        File(path, table, time_column(table) or ("" if table.sampling_rate else _rising(table)))
        for path, table in zip(paths, tables, strict=True)
    ]
    steps = {file: time_step_of(file.table, file.time) or 1.0 for file in files}
    for file, step in steps.items():
        table, time = file.table, file.time
        said = time in table.units or named_unit(time)[1]
        usual = min(own for other, own in steps.items() if file.is_like(other))
        if not said and step < SERIAL:
            table.units[time] = "d"
        elif time and not said and 500 < step / usual < 2000:  # the others are in seconds
            table.units[time] = "ms"
        from_midnight(table, FileSettings(time=time))
    for placed in placings(files):
        runs, loggers = {file.run for file in placed}, {file.logger for file in placed}
        one_each = len(runs) == len(files) or "" in runs | loggers
        if not (one_each or any(misplaced(placed))):
            return placed
    stems, above = [_stem(path) for path in paths], [_by_folder(path)[0] for path in paths]
    if len(set(stems)) == 1 < len(set(above)):
        stems = above
    taken: Counter[str] = Counter()
    return [replace(f, run=_free(stem, taken)) for f, stem in zip(files, stems, strict=True)]


def placings(files: Files) -> Iterator[list[File]]:
    """Files with the run and logger that their folders say, then with those of their names."""
    for keys in ([_by_folder(file.path) for file in files], _by_name(files)):
        yield [replace(f, run=run, logger=at) for f, (run, at) in zip(files, keys, strict=True)]


def misplaced(files: Files) -> Iterator[tuple[File, File]]:
    """Two files each: of one run with like columns, or of one logger with others."""
    for one, other in combinations(files, 2):
        if one.run == other.run if one.is_like(other) else one.logger == other.logger:
            yield one, other


def _free(stem: str, taken: Counter[str]) -> str:
    """Name that is not taken: the stem, or the stem and the next number."""
    name = stem
    while name in taken:
        taken[stem] += 1
        name = f"{stem}_{taken[stem]}"
    taken[name] = 1
    return name


def guess_channels(files: Files) -> list[Guess]:
    """Guess a channel for each column of the first file of each logger."""
    out = []
    taken: Counter[str] = Counter()
    for logger in dict.fromkeys(file.logger for file in files):
        same = [file for file in files if file.logger == logger]
        for column in same[0].table.names:
            if column != same[0].time and not (logger and is_trigger(column)):
                guess = _guess(column, same)
                name = guess.channel and _free(guess.channel, taken)
                out.append(replace(guess, channel=name))
    # Motions and waves beside which others of their unit move far more.
    sizes, largest = {}, defaultdict[tuple[str, bool], float](float)
    for guess in out:
        if guess.is_motion or is_elevation(guess.channel):
            series = [f.table.values[guess.column] for f in files if f.logger == guess.logger]
            spans = [np.percentile(each[np.isfinite(each)], [5, 95]) for each in series]
            unit = si_unit(guess.unit)
            kind, size = (unit, guess.is_motion), max(map(np.ptp, spans))
            sizes[guess.channel] = kind, size * conversion(guess.unit, unit)
            largest[kind] = max(largest[kind], sizes[guess.channel][1])
    rests = {name for name, (kind, size) in sizes.items() if size <= AT_REST * largest[kind]}
    return [replace(each, at_rest=each.channel in rests) for each in out]


def dead_motions(files: Files, guesses: Guesses) -> dict[str, str]:
    """Runs in which a motion that others show is constant, as where its sensor is dead."""
    dead: dict[str, str] = {}
    for guess, file in product(guesses, files):
        if guess.is_motion and not guess.at_rest and file.logger == guess.logger:
            values = file.table.values[guess.column]
            if np.ptp(values[np.isfinite(values)]) == 0:
                dead.setdefault(file.run, guess.channel)
    return dead


def _guess(column: str, files: Files) -> Guess:
    table, logger = files[0].table, files[0].logger
    header = _printable(table.headers.get(column, column))
    stated = [file.table.units[column] for file in files if column in file.table.units]
    if is_trigger(column):
        return Guess(column, header, "-", "nobody", why="pulses of a trigger")
    name, unit = column, next(iter(stated), None)
    stated_by: Literal["files", "some", "name", "nobody"] = "files"
    if unit is None:
        bare, named = named_unit(column)
        stated_by = "nobody"
        if named and si_unit(named) != "s":  # "Tension_s" is a side, and no time
            name, unit, stated_by = bare, named, "name"
    elif len(stated) < len(files) and all(same_unit(unit, u) for u in stated):
        stated_by = "some"
    why, gaps = _fault(column, files)
    if unit is not None and not is_unit(unit):
        why = why or f"its unit '{unit}' is not known; state unit = '…'"
    # One file per run may be that of one logger, whose name says what it measured.
    channel = "" if why else suggest_channel(name, unit, logger or _stem(files[0].path))
    canonical = canonical_channel(channel)
    unit = unit if unit is not None else canonical.units if canonical else "-"
    return Guess(column, header, unit, stated_by, channel, logger, _printable(why), gaps,
                 behind="behind" in kinds_of(column))  # fmt: skip


def _printable(text: str) -> str:
    """Text for a comment of TOML, which has one line."""
    return re.sub(r"[\x00-\x08\x0a-\x1f\x7f]", "?", text)


def _fault(column: str, files: Files) -> tuple[str, Literal["", "short", "long"]]:
    """Why a column cannot be a channel, if it cannot; and what gaps it has."""
    if why := files[0].table.faults.get(column):
        return why.removeprefix(f"{files[0].path}: "), ""
    if bad := [f for f in files if column not in f.table.values]:
        return f"missing or unusable in {_listed(bad)}", ""
    missing = {f: ~np.isfinite(f.table.values[column]) for f in files}
    if gapped := [f for f, m in missing.items() if m.mean() > 1 - USABLE]:
        return f"has gaps in {_listed(gapped)}", "long"
    if all(_step_of(f.table.values[column]) == 1.0 for f in files):
        return "it counts; if it counts seconds, state time = …", ""
    lengths = [
        (end - start) / (f.rate or np.inf)
        for f, m in missing.items()
        for start, end in stretches(m)
    ]
    return "", "" if not lengths else "short" if max(lengths) <= SHORT_GAP else "long"


def _rising(table: Columns) -> str:
    """Name of the first column that rises and has a word for times in its name, such as "t_DAQ".

    Without any it is the first that rises evenly, unless it counts 1, 2, 3; empty if there is none.
    One that a unit says to be something else is none.
    """
    even = ""
    for column, series in table.values.items():
        unit = table.units.get(column) or named_unit(column)[1]
        if unit and not (is_unit(unit) and si_unit(unit) == "s"):
            continue
        rises = series.size >= LONG and np.all(np.diff(past_midnight(series)) > 0)
        if "time" in kinds_of(column) and rises:
            return column
        if not even and _step_of(series) not in (None, 1.0):
            even = column
    return even


def _step_of(series: FloatArray) -> float | None:
    """Step of a column that rises evenly; None for any other."""
    if series.size < LONG:
        return None
    try:
        return uniform_step(series)
    except DataError:
        return None


def _listed(files: Files) -> str:
    return ", ".join(f"{f.run}/{f.path.name}" if f.logger else f.path.name for f in files[:3])


def _channels(column: str, dimension: str | None, logger: str) -> Iterator[str]:
    """Canonical channels that words, unit and logger may mean, the likeliest first.

    A range to the waves is no elevation: it has the other sign, and the vessel's own motion.
    """
    words, kinds = words_of(column), kinds_of(column)
    numbers = [word for word in words if word.isdigit()]
    if "range" not in kinds:
        if "wave" in kinds:
            places = [word for word in words if word in CALLED["place"]]
            yield "eta_" + ("_".join(words[1:] if words[0] == "eta" else places + numbers) or "1")
        if dimension == "m" and "wave" in kinds_of(logger):
            yield "eta_" + "_".join(words)
    yield from motions_of(column)
    if "load" in kinds and set(words).isdisjoint(chain(*CALLED["motion"].values())):
        ends = [CALLED["ends"][word] for word in words if word in CALLED["ends"]]
        sides = [CALLED["sides"][word] for word in words if word in CALLED["sides"]]
        if place := list(dict.fromkeys(ends)) or sides or numbers:
            yield "mooring_" + "_".join(place)


def suggest_channel(column: str, unit: str | None, logger: str) -> str:
    """Name for a column: a canonical one if words and unit speak for it, else the column's own.

    A length of a logger called "wave_probes" is an elevation.
    """
    words = words_of(column)
    dimension = None if unit is None else si_unit(unit)

    def fits(name: str) -> bool:
        canonical = canonical_channel(name)
        return canonical is not None and dimension in (None, canonical.units)

    if suggested := next(filter(fits, _channels(column, dimension, logger)), None):
        return suggested
    free = "_".join(words) or "channel"
    free = free if not free[0].isdigit() else f"column_{free}"
    taken = free == "time" or free.endswith("_flags")
    return f"{free}_signal" if taken or (canonical_channel(free) and not fits(free)) else free
