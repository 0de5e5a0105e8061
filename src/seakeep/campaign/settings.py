"""Tables of a campaign file: one frozen table per section, and what they say against one another.

Nothing is read from disk here. Pydantic validates a table, and :func:`cross_checks` all of them
together; one message names every mistake. The text below a field is the remedy that it proposes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from seakeep.conventions import TURNS, canonical_channel, conversion, is_elevation, si_unit
from seakeep.errors import RequestError, did_you_mean
from seakeep.formats import Options
from seakeep.signals.expressions import parse
from seakeep.toml import (
    Duration,
    Finite,
    Instant,
    Listed,
    Mistake,
    Names,
    NotNegative,
    Pair,
    Positive,
    Span,
    Table,
    in_seconds,
    lengths,
    packaged,
    parse_length,
)


class GeneralSettings(Table):
    """``[campaign]``: what the campaign is called, its scale and its encounter period."""

    name: str = ""
    """a name for titles and tables"""
    description: str = ""
    """free text"""
    scale_factor: Positive = 1.0
    """full-scale length over model length, such as 30.0"""
    encounter_period: Positive | None = None
    """mean encounter period in seconds; left out, it is measured, in test runs too"""
    period_channel: str | None = None
    """the wave channel whose zero-up-crossings define the encounter period"""
    period_hysteresis: Annotated[float, Field(ge=0, lt=1)] = 0.0
    """fraction of its standard deviation by which a wave must pass its mean either way to count; 0,
    the paper's, counts all. Still water around the waves never counts"""


class RigSettings(Table):
    """``[rig]``: the basin and where things stand in it."""

    water_depth: Annotated[float, AfterValidator(_depth)] | None = None
    """water depth in metres; inf, without quotes, for deep water; left out at forward speed, where
    linear dispersion does not hold"""
    wave_direction: Finite | None = None
    """direction in which the waves run, degrees from the x axis"""
    frame: str | None = None
    """words that describe the frame"""
    positions: dict[str, Finite] = Field(default={})
    """channel = x position in metres, along the waves"""


class TimesSettings(Table):
    """What a file's times are, in ``[files]`` and ``[instruments.NAME]``."""

    time: str | None = None
    """the name of the time column"""
    time_unit: str | None = None
    """unit of the time column, such as 'ms'"""
    sampling_rate: Positive | None = None
    """samples per second, for files that have no time column"""
    sampling_rate_assumed: bool = False
    """true while sampling_rate is a guess: prepare warns until it is removed"""


class FileSettings(Options, TimesSettings):
    """``[files]``: how the files of the runs are to be read; all of it is optional."""


class ChannelSettings(Table):
    """``[channels.NAME]``: where a channel comes from.

    The channel is ``sign * (reading + offset)``, converted from `unit` to SI: the offset is added
    to the reading, in the file's unit, before the sign.
    """

    column: str | None = None
    """the column in the file; left out, the channel's own name"""
    instrument: str | None = None
    """whose file holds it, where several files have such a column"""
    unit: str | None = None
    """unit of the column, such as 'mm'; left out, the file's header"""
    unit_assumed: bool = False
    """true while unit is a guess: prepare warns until it is removed"""
    sign: Literal[1, -1] = 1
    """1 or -1"""
    offset: Finite = 0.0
    """added to the reading, in the file's unit, before the sign"""
    accuracy: NotNegative | None = None
    """standard uncertainty of the instrument, in the file's unit (type B)"""
    long_name: str | None = None
    """name for labels"""


def _rising_band(band: tuple[float, float]) -> tuple[float, float]:
    if not band[0] < band[1]:
        raise ValueError("a band is [low, high] in Hz, the low one first")
    return band


def _channel_name(name: str) -> str:
    """Refuse names that no NetCDF variable can have."""
    if name == "time" or name.endswith("_flags"):
        raise ValueError(
            "a channel is not called 'time', nor does its name end in '_flags': a run's instants "
            "and its quality flags are called so; rename it"
        )
    if not name.strip(". ") or len(name) > LONGEST_NAME or "/" in name or not name.isprintable():
        raise ValueError(
            f"a name has 1 to {LONGEST_NAME} characters, not dots alone, and holds no '/' and no "
            "control characters, because variables of files are named after it; rename it"
        )
    return name


def _depth(depth: float) -> float:
    """Refuse depths whose waves cannot be computed."""
    if not (1e-3 <= depth <= 1e5 or depth == math.inf):
        raise ValueError("a water depth is 0.001 to 100 000 m, or inf for deep water; correct it")
    return depth


def _run_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.+-]{,99}", name):
        raise ValueError(
            "the name of a run is made of at most 100 letters, digits and '_', '-', '.', '+', and "
            "starts with a letter or digit, because files are named after it; rename it"
        )
    return name


LONGEST_NAME = 100
"""Characters of a name: file systems allow 255 bytes, of which our own prefixes and suffixes take
some."""
ChannelName = Annotated[str, AfterValidator(_channel_name)]
RunName = Annotated[str, AfterValidator(_run_name)]
Band = Annotated[Pair, AfterValidator(_rising_band)]
TwoColumns = Annotated[tuple[str, str], Listed]
Vector = Annotated[tuple[Finite, Finite, Finite], Listed]


class InstrumentSettings(TimesSettings):
    """``[instruments.NAME]``: a logger with a file of its own in each run, and its clock.

    The clock is found from a trigger that the reference records too, from a signal that both
    hold (`shared`), or from two that go together (`correlated`); without these it is `offset` and
    `drift` as stated, or the reference's own clock.
    """

    group: str | None = None
    """the part of its file that is read, as in [files]; several loggers may share a file"""
    trigger: str | None = None
    """the column that holds the trigger"""
    trigger_unit: str | None = None
    """unit of the trigger, for the eye"""
    shared: TwoColumns | None = None
    """[own column, reference's column] of one signal both record"""
    correlated: TwoColumns | None = None
    """[own column, reference's column] of signals that go together"""
    window: Duration = 20.0
    """length of correlation windows, s or periods"""
    largest_lag: Duration = 5.0
    """lags searched on either side, s or periods"""
    offset: Finite | None = None
    """reading of its clock at reference time 0, s; beside trigger, shared or correlated, near which
    it is searched"""
    drift: Finite | None = None
    """drift of its clock, ppm; without trigger, shared or correlated, which find it"""
    metres_per_pixel: Positive | None = None
    """of a camera, in the vessel's plane"""
    panel: Pair | None = None
    """[length, height] of the panel that a camera tracks, m"""
    panel_height: Finite | None = None
    """of the panel's centre above the centre of gravity, m"""

    @model_validator(mode="after")
    def _one_way(self) -> InstrumentSettings:
        given = [k for k in ("trigger", "shared", "correlated") if getattr(self, k) is not None]
        if len(given) > 1:
            raise ValueError(f"state only one of {', '.join(given)} to find the clock from")
        if given and self.drift is not None:
            raise ValueError(f"drift is found from {given[0]}, as offset is: leave drift out")
        return self


class InstrumentsSettings(Table):
    """``[instruments]``: whose clock is time, and a table for each logger."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, InstrumentSettings] = Field(init=False)

    reference: str | None = None
    """the logger whose clock is the time of all; the first by default"""
    pool_drift: bool = True
    """true: one drift per logger for all runs that agree"""

    @property
    def loggers(self) -> dict[str, InstrumentSettings]:
        """Tables of the loggers by name."""
        return dict(self.__pydantic_extra__ or {})

    def __getitem__(self, name: str) -> InstrumentSettings:
        """Settings of a logger; the default ones where it has no table."""
        return self.loggers.get(name, InstrumentSettings())


_STEPS = packaged("campaign/steps.toml")
"""Steps by name: keys that each needs, others that it knows, and what a message asks for."""
Step = Literal[
    "integrate", "differentiate", "band_pass", "low_pass", "envelope_squared",
    "complementary_filter", "transfer", "remove_gravity",
]  # fmt: skip


class DerivedSettings(Table):
    """``[derived.NAME]``: a channel made from others, by an expression or by a named step."""

    expression: str | None = None
    """such as '0.5*(acc_sb + acc_ps)', of channels in SI units and radians, whatever the units of
    their columns; knows + - * / **, square, abs, sqrt, sin, cos, mean (over time) and average (of
    several channels)"""
    source: str | None = Field(default=None, alias="from")
    """the channel that the step works on"""
    step: Step | None = None
    """what to do with the channel named by 'from'"""
    times: Literal[1, 2] | None = None
    """integrate once or twice"""
    band: Band | None = None
    """[low, high] in Hz, kept by 'integrate' and 'band_pass'"""
    passband: Positive | None = None
    """edge of the pass band, Hz"""
    stopband: Positive | None = None
    """edge of the stop band, Hz"""
    position: str | None = None
    """'complementary_filter': the measured position that gives the slow part"""
    crossover: Positive | None = None
    """'complementary_filter': where both count half, below the waves, Hz"""
    offset: Vector | None = None
    """'transfer': [x, y, z] from the measured to the wanted point, m, in the body's axes (x
    downstream, z up)"""
    axis: Literal["x", "y", "z"] | None = None
    """direction of a channel that is not called surge, sway or heave"""
    components: Annotated[tuple[str, str, str], Listed] | None = None
    """'remove_gravity': accelerometers along x, y and z of the body"""
    zeroed: bool | None = None
    """'remove_gravity': true where readings were set to zero at rest, false where the one along z
    reads +9.81 m/s^2 there"""
    unit: str | None = None
    """unit of the number that the expression gives, so of angles 'rad'; needed for free names; the
    channel itself is in SI units"""
    long_name: str | None = None
    """name for labels"""

    @model_validator(mode="after")
    def _one_way(self) -> DerivedSettings:
        if (self.expression is None) == (self.step is None):
            raise ValueError("a derived channel needs either 'expression', or 'from' and 'step'")
        given = self.model_fields_set - {"expression", "source", "step", "unit", "long_name"}
        if self.step is None:
            if self.source is not None or given:
                raise ValueError("'from' and the keys of steps do not go with 'expression'")
            return self
        if self.source is None:
            raise ValueError(f"step '{self.step}' needs 'from', the channel it works on")
        needed, others, words = _STEPS[self.step]
        if extra := given.difference(needed, others):
            raise ValueError(f"step '{self.step}' has no key {sorted(extra)[0]!r}; remove it")
        if not given.issuperset(needed):
            raise ValueError(f"step '{self.step}' needs {words}")
        return self


class RedundantSettings(Table):
    """``[redundant.NAME]``: channels that measure one quantity; the first is trusted."""

    channels: Names
    """two channels or more of one unit, the trusted one first"""
    window: Duration | None = None
    """length of the windows compared, s or periods; by default 4 dominant periods"""

    @model_validator(mode="after")
    def _several(self) -> RedundantSettings:
        if len(self.channels) < 2 or len(set(self.channels)) < len(self.channels):
            raise ValueError("redundant channels are two different ones or more")
        return self


_FILTERS: dict[str, dict[str, Any]] = {
    "paper": {"anti_alias": False, "low_pass": (10.0, 10.75)},
    "recommended": {"anti_alias": True},
}
"""Filters before resampling by preset."""


class PreparationSettings(Table):
    """``[preparation]``: the common time step and how it is reached.

    The preset ``paper`` filters every channel that was sampled fast enough as the paper does
    (pass 10 Hz, stop 10.75 Hz, 60 dB) and then takes 32 samples per period without another filter;
    ``recommended`` filters below 0.8 of the new Nyquist frequency. Keys that are stated replace
    those of the preset.
    """

    preset: Literal["paper", "recommended"] | None = None
    """'paper' or 'recommended'; left out, the filters (not the rate) of the preset of the study,
    else of [model]"""
    sampling_rate: Positive | None = None
    """samples per second, Hz"""
    dt: Positive | None = None
    """time step in seconds"""
    steps_per_period: Annotated[int, Field(ge=4)] | None = None
    """samples per mean encounter period; 32 is the paper's"""
    attenuation: Annotated[float, Field(ge=50, le=200)] = 60.0
    """attenuation above the new Nyquist frequency, dB, at least 50"""
    low_pass: Band | None = None
    """[pass, stop] in Hz, of all channels sampled fast enough"""
    anti_alias: bool = True
    """false: take samples without a filter at the new Nyquist"""
    gaps: Literal["refuse", "mask", "bridge"] = "refuse"
    """'refuse': an error; 'mask': NaN where samples are missing; 'bridge': short gaps filled and
    flagged, NaN in the others"""
    longest_gap: Positive = 0.25
    """longest gap that 'bridge' fills, s"""
    jitter: Literal["refuse", "interpolate"] = "refuse"
    """'refuse' or 'interpolate' times that are not uniform"""
    outliers: Literal["flag", "replace"] = "flag"
    """'flag', or 'replace' by what is interpolated across them"""

    @model_validator(mode="after")
    def _one_rate(self) -> PreparationSettings:
        given = [k for k in ("sampling_rate", "dt", "steps_per_period") if getattr(self, k)]
        if len(given) > 1:
            raise ValueError(f"state only one of {', '.join(given)}")
        return self

    def with_preset(self, preset: str | None) -> PreparationSettings:
        """Take filters and rate of the preset that is stated, else the filters of another one.

        Keys that are stated stay.
        """
        chosen = self.preset or preset
        if chosen is None:
            return self
        if chosen not in _FILTERS:
            raise RequestError(
                f"preset must be {' or '.join(map(repr, _FILTERS))}; received {preset!r}."
            )
        taken = {"preset": chosen, **_FILTERS[chosen]}
        if self.preset and not (self.sampling_rate or self.dt):
            taken["steps_per_period"] = 32
        return self.model_copy(
            update={key: taken[key] for key in taken.keys() - self.model_fields_set}
        )


class RunSettings(Table):
    """``[runs.NAME]``: one run, its file or files, and its role.

    `file` where one file holds all channels, else `files`, one per instrument. Either `role` (with
    an optional `span`, the part that is used), or `train` and `test`, spans of one run that is
    used for both. `record` cuts the files before anything else is done with them.
    """

    file: str | None = None
    """the file, relative to the campaign file"""
    files: dict[str, str] = Field(default={})
    """instrument = its file, relative to the campaign file"""
    sea_state: str = ""
    """a name for the sea state"""
    time_unit: str | None = None
    """unit of the time column of its files, such as 'ms', where it is not that of [files]"""
    waves: Literal["regular", "irregular", "still"] | None = None
    """'regular', 'irregular', or 'still' of a free decay"""
    role: Literal["train", "test", "unused"] | None = None
    """'train', 'test' or 'unused'"""
    span: Span | None = None
    """[start, end] in s or periods ('10 T'): the part used"""
    train: Span | None = None
    """[start, end] in s or periods, used for training"""
    test: Span | None = None
    """[start, end] in s or periods, used for testing"""
    record: Span | None = None
    """[start, end] in s or periods: the part read"""
    channels: dict[str, ChannelSettings] = Field(default={})
    """keys of [channels.NAME] that differ in this run"""
    probe_offset: Finite | None = None
    """metres by which this run's elevations are carried, positive downstream"""
    parameters: dict[str, Finite] = Field(default={})
    """attribute = number, such as draught = 0.083, for the 'parameter' of a model"""

    @property
    def serves(self) -> str:
        """Role of the run: "train", "test", "train and test" or "unused"."""
        spans = " and ".join(use for use in ("train", "test") if getattr(self, use))
        return spans or self.role or "train"

    @model_validator(mode="after")
    def _one_use(self) -> RunSettings:
        if (self.file is None) == (not self.files):
            raise ValueError(
                "a run needs either 'file', relative to the campaign file, or 'files', a table of "
                "one file per instrument"
            )
        if self.role is not None and (self.train or self.test):
            raise ValueError(
                "'role' does not go with 'train' and 'test'; state the role and 'span', or the "
                "two spans"
            )
        return self


def _read_lengths(value: object) -> object:
    """Texts such as ``"1 T"``, wherever they stand in a table, as lengths."""
    if isinstance(value, dict):
        return {key: _read_lengths(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return tuple(_read_lengths(each) for each in value)
    try:
        return parse_length(value) if isinstance(value, str) else value
    except RequestError:
        return value


class ModelSettings(Table):
    """``[model]`` and ``[models.NAME]``: states, inputs, and the keys of the model's own kind.

    The kind reads its keys itself: they are the arguments of its constructor. What is left out,
    the preset or the constructor decides.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[Any, BeforeValidator(_read_lengths)]] = Field(
        init=False
    )

    kind: str = "hankel_dmdc"
    """'hankel_dmdc', 'bayesian_hankel_dmdc', or any other registered kind, such as 'arx'"""
    preset: Literal["paper", "recommended"] | None = None
    """'paper' or 'recommended'"""
    states: Annotated[tuple[str, ...], Field(strict=False, min_length=1)]
    """list of channels that the model forecasts"""
    inputs: Names = ()
    """list of channels that drive the model"""
    stop: Instant | None = None
    """end of the training window, s or periods such as '60 T'"""

    def arguments(self) -> dict[str, Any]:
        """Keys of the constructor that the file states.

        Examples
        --------
        >>> ModelSettings(states=("heave",), ridge=100.0).arguments()
        {'ridge': 100.0}
        """
        return dict(self.model_extra or {})


class CampaignSettings(Table):
    """A whole campaign file."""

    campaign: GeneralSettings = GeneralSettings()
    rig: RigSettings = RigSettings()
    files: FileSettings = FileSettings()
    channels: dict[ChannelName, ChannelSettings] = Field(min_length=1)
    """a table [channels.NAME] per channel, empty where defaults fit"""
    derived: dict[ChannelName, DerivedSettings] = Field({})
    instruments: InstrumentsSettings = InstrumentsSettings()
    redundant: dict[str, RedundantSettings] = Field({})
    runs: dict[RunName, RunSettings] = Field(min_length=1)
    """at least one table [runs.NAME] with a file"""
    preparation: PreparationSettings = PreparationSettings()
    model: ModelSettings | None = None
    models: dict[str, ModelSettings] = Field({})

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the mapped and the derived channels, in the file's order."""
        return (*self.channels, *self.derived)

    @property
    def wave_channel(self) -> str | None:
        """Channel that defines the encounter period: stated, or the first wave elevation.

        Elevations (``eta_…``) that drive a model come first; without any it is the first input.
        """
        if self.campaign.period_channel is not None:
            return self.campaign.period_channel
        inputs = [name for model in self.all_models().values() for name in model.inputs]
        waves = [name for name in (*inputs, *self.channel_names) if is_elevation(name)]
        return next(iter((*waves, *inputs)), None)

    @property
    def used_runs(self) -> list[str]:
        """Names of the runs that are used, in the file's order."""
        return [name for name, run in self.runs.items() if run.role != "unused"]

    @property
    def period_runs(self) -> tuple[str, ...]:
        """Runs over which the period is measured: irregular ones, or all with waves if none is."""
        waves = {name: self.runs[name].waves for name in self.used_runs}
        irregular = [name for name, kind in waves.items() if kind == "irregular"]
        return tuple(irregular or (name for name, kind in waves.items() if kind != "still"))

    @property
    def preset(self) -> str | None:
        """Preset of the model, or the one that all models share."""
        stated = {each.preset for each in self.all_models().values()}
        return self.model.preset if self.model else stated.pop() if len(stated) == 1 else None

    @property
    def celerity_channels(self) -> tuple[str, str] | None:
        """Elevations, first and last along the waves, between which a run's celerity is found.

        Those that drive the first model that has two at different positions, else all.
        """
        waves = [name for name in self.channel_names if is_elevation(name)]
        for names in (*(model.inputs for model in self.all_models().values()), waves):
            placed = {n: self.rig.positions[n] for n in names if n in self.rig.positions}
            if len(set(placed.values())) > 1:
                return min(placed, key=placed.__getitem__), max(placed, key=placed.__getitem__)
        return None

    def all_models(self) -> dict[str, ModelSettings]:
        """Models by the key of their table: ``model`` and ``models.NAME``."""
        named = {f"models.{name}": each for name, each in self.models.items()}
        return {"model": self.model, **named} if self.model else named


def long_name_of(name: str, stated: str | None) -> str:
    """Label of a channel: the one stated, the canonical one, or the name with spaces."""
    canonical = canonical_channel(name)
    return stated or (canonical.long_name if canonical else name.replace("_", " "))


def units_of(name: str, unit: str) -> str:
    """SI unit in which a channel is kept: the canonical one, or that of the dimension of `unit`."""
    canonical = canonical_channel(name)
    return canonical.units if canonical else si_unit(unit)


def needed_channels(settings: CampaignSettings, wanted: Collection[str] | None = None) -> list[str]:
    """Names of channels, by default all, and of all that they are derived from, these first."""
    graph: dict[str, Sequence[str]] = {}
    ahead = list(settings.channel_names if wanted is None else wanted)
    while ahead:
        if (name := ahead.pop(0)) not in graph:
            own = settings.derived.get(name)
            graph[name] = sources_of(name, own, settings.channel_names) if own else ()
            ahead += graph[name]
    try:
        return list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        raise RequestError(
            "derived channels need one another in a circle: "
            f"{' -> '.join(reversed(error.args[1]))}. Make one of them from measured channels."
        ) from None


def sources_of(name: str, settings: DerivedSettings, channels: Collection[str]) -> tuple[str, ...]:
    """Channels that a derived channel needs."""
    if settings.expression is not None:
        return parse(settings.expression).channels
    sources = [str(settings.source)]
    if settings.position is not None:
        sources.append(settings.position)
    sources += settings.components or ()
    if settings.step in ("transfer", "remove_gravity"):
        turning = ["", "_rate", "_acceleration"]
        if settings.step == "remove_gravity":
            turning = [""]
        elif known := canonical_channel(sources[0]) or canonical_channel(name):
            turning = turning[: {"m": 1, "m/s": 2}.get(known.units, 3)]
        sources += [turn + kind for kind in turning for turn in TURNS if turn + kind in channels]
    return tuple(dict.fromkeys(each for each in sources if each != name))


def cross_checks(settings: CampaignSettings) -> Iterable[Mistake]:
    """What tables of a campaign say against one another."""
    yield from _unit_mistakes(settings)
    yield from _derived_mistakes(settings)
    yield from _name_mistakes(settings)
    wave = settings.campaign.period_channel
    if wave is None or wave in settings.channel_names:
        yield from _period_mistakes(settings)
    known = list(settings.instruments.loggers)
    used = {logger for run in settings.runs.values() for logger in run.files}
    reference = settings.instruments.reference
    if reference is not None and reference not in {*known, *used}:
        yield (
            ("instruments", "reference"),
            f"received {reference!r}, which no run has a file of."
            f"{did_you_mean(reference, sorted(used))}",
        )
    for run, each in settings.runs.items():
        for logger in each.files:
            if known and logger not in known:
                yield (
                    ("runs", run, "files", logger),
                    f"no table [instruments.{logger}].{did_you_mean(logger, known)} "
                    f"Instruments: {', '.join(known)}.",
                )
    spelt: dict[str, str] = {}
    for run, each in settings.runs.items():
        if (other := spelt.setdefault(run.lower(), run)) != run:
            yield (
                ("runs", run),
                f"'{other}' differs only in the case of its letters, and files are named after "
                "both. Rename one.",
            )
        for name in each.channels:
            if name not in settings.channels:
                yield (
                    ("runs", run, "channels", name),
                    f"no table [channels.{name}] to change.{did_you_mean(name, settings.channels)} "
                    "Add it there first.",
                )


def span_mistakes(settings: CampaignSettings, period: float) -> Iterable[Mistake]:
    """Spans of which one end counts in periods, and which run backwards with a period (s)."""
    for run, each in settings.runs.items():
        for key in ("record", "span", "train", "test"):
            if (span := getattr(each, key)) is None:
                continue
            start, end = (in_seconds(edge, period) for edge in span)
            if not start < end:
                yield (
                    ("runs", run, key),
                    f"received [{span[0]}, {span[1]}], which with an encounter period of "
                    f"{period:.6g} s is [{start:g}, {end:g}]. State the lower one first.",
                )


def _name_mistakes(settings: CampaignSettings) -> Iterable[Mistake]:
    """Names of channels that the campaign has no channel of."""
    names = settings.channel_names
    wanted: list[tuple[tuple[str, ...], str]] = [
        (("rig", "positions", name), name) for name in settings.rig.positions
    ]
    if settings.campaign.period_channel is not None:
        wanted.append((("campaign", "period_channel"), settings.campaign.period_channel))
    for table, model in settings.all_models().items():
        place = tuple(table.split(".", 1))
        wanted += [((*place, key), n) for key in ("states", "inputs") for n in getattr(model, key)]
    for key, pair in settings.redundant.items():
        wanted += [(("redundant", key, "channels"), name) for name in pair.channels]
    for place, name in wanted:
        if name not in names:
            received = "" if place[-1] == name else f"received {name!r}, "
            yield (
                place,
                f"{received}no such channel.{did_you_mean(name, names)} "
                f"Channels: {', '.join(names)}.",
            )


def _period_mistakes(settings: CampaignSettings) -> Iterable[Mistake]:
    """Keys in encounter periods where there is no period, or where it is measured with them."""
    wave, stated = settings.wave_channel, settings.campaign.encounter_period
    if stated:
        yield from span_mistakes(settings, stated)
        return
    for place in lengths(settings):
        head, name, *_ = place
        if wave is None:
            yield (
                place,
                "counts in encounter periods, and the campaign has none. State encounter_period "
                "(s) or period_channel in [campaign], or name a channel eta_…",
            )
            return
        if (head == "runs" and name in settings.period_runs) or head == "instruments":
            yield (
                place,
                "counts in encounter periods, and the period is measured with it, as the "
                f"zero-up-crossing period of {wave}. State encounter_period (s) in [campaign], or "
                "this in seconds.",
            )


def _unit_mistakes(settings: CampaignSettings) -> Iterable[Mistake]:
    tables: dict[tuple[str, ...], Mapping[str, ChannelSettings | DerivedSettings]] = {
        ("channels",): settings.channels,
        ("derived",): settings.derived,
    }
    tables |= {("runs", run, "channels"): each.channels for run, each in settings.runs.items()}
    for place, channels in tables.items():
        for name, each in channels.items():
            if each.unit is None:
                continue
            try:
                conversion(each.unit, units_of(name, each.unit), name)
            except RequestError as error:
                yield (*place, name, "unit"), str(error)


def _derived_mistakes(settings: CampaignSettings) -> Iterable[Mistake]:
    names = settings.channel_names
    sound = True
    for name, each in settings.derived.items():
        place = ("derived", name)
        if name in settings.channels:
            yield place, f"[channels.{name}] exists too. Rename one of them."
        try:
            sources = sources_of(name, each, names)
        except RequestError as error:
            sound = False
            yield (*place, "expression"), str(error)
            continue
        for source in sources:
            if source not in names:
                yield (
                    (*place, "from" if each.expression is None else "expression"),
                    f"the channel '{source}' does not exist.{did_you_mean(source, names)} "
                    f"Channels: {', '.join(names)}.",
                )
        if each.expression is not None and each.unit is None and canonical_channel(name) is None:
            yield (
                (*place, "unit"),
                f"missing. '{name}' is a free name; state the unit of the expression, such as "
                "unit = 'm' ('-' for none).",
            )
    if sound:
        try:
            needed_channels(settings)
        except RequestError as error:
            yield ("derived",), str(error)
