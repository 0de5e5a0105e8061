"""What a campaign file may say: one frozen table a section, validated by pydantic.

Nothing is read from disk here; :mod:`seakeep.campaign.validation` fills these tables from TOML and
turns what does not fit into messages. A field's description is the mend that a message proposes.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from seakeep.campaign.chain_settings import (
    DerivedSettings,
    InstrumentSettings,
    InstrumentsSettings,
    PreparationSettings,
    RedundantSettings,
)
from seakeep.campaign.tables import (
    Finite,
    Instant,
    Names,
    Positive,
    RunName,
    Samples,
    Span,
    Table,
    Window,
)
from seakeep.conventions import canonical_channel
from seakeep.errors import did_you_mean

__all__ = [
    "AlignmentSettings",
    "CampaignSettings",
    "ChannelSettings",
    "DerivedSettings",
    "FileSettings",
    "GeneralSettings",
    "InstrumentSettings",
    "InstrumentsSettings",
    "ModelSettings",
    "PreparationSettings",
    "PriorSettings",
    "RedundantSettings",
    "RigSettings",
    "RunSettings",
]


class GeneralSettings(Table):
    """``[campaign]``: what the campaign is called, its scale and its encounter period."""

    name: str = Field(default="", description="a name for titles and tables")
    description: str = Field(default="", description="free text")
    scale_factor: Positive = Field(
        default=1.0, description="full-scale length over model length, such as 30.0"
    )
    encounter_period: Positive | None = Field(
        default=None, description="mean encounter period in seconds; left out, it is measured"
    )
    period_channel: str | None = Field(
        default=None,
        description="the wave channel whose zero-up-crossings define the encounter period",
    )
    period_hysteresis: Annotated[float, Field(ge=0, lt=1)] = Field(
        default=0.0,
        description="part of its standard deviation by which a wave must pass its mean either way "
        "to count; 0, the paper's, counts all. Still water around the waves never counts",
    )


class RigSettings(Table):
    """``[rig]``: the basin and where things stand in it."""

    water_depth: Annotated[float, Field(gt=0)] | None = Field(
        default=None, description="water depth in metres; 'inf' for deep water"
    )
    wave_direction: Finite | None = Field(
        default=None, description="direction in which the waves run, degrees from the x axis"
    )
    frame: str | None = Field(default=None, description="words that describe the frame")
    positions: dict[str, Finite] = Field(
        default_factory=dict, description="channel = x position in metres, along the waves"
    )


class FileSettings(Table):
    """``[files]``: how the files of the runs are to be read; all of it is optional."""

    time: str | None = Field(default=None, description="the name of the time column")
    time_unit: str | None = Field(default=None, description="unit of the time column, such as 'ms'")
    sampling_rate: Positive | None = Field(
        default=None, description="samples a second, for files that have no time column"
    )
    sampling_rate_assumed: bool = Field(
        default=False,
        description="true while sampling_rate is a guess: prepare warns until it is removed",
    )
    delimiter: Literal[",", ";", "\t", " "] | None = Field(
        default=None, description="',' or ';' or '\\t', or ' ' for any number of blanks"
    )
    decimal: Literal[".", ","] | None = Field(default=None, description="'.' or ','")
    comment: Annotated[str, Field(min_length=1)] | None = Field(
        default=None, description="the mark that begins a comment line; '#' and '%' are known"
    )
    skip_rows: Annotated[int, Field(ge=0)] = Field(
        default=0, description="lines to leave out at the head of the file"
    )
    encoding: str | None = Field(
        default=None,
        description="of a text file, such as 'utf-8', 'cp1252' or 'utf-16-le'; left out, UTF-8, "
        "UTF-16 with its mark, or Windows-1252 (Latin-1)",
    )
    group: str | None = Field(
        default=None,
        description="the part of a file that is read, where it holds several: the group of a TDMS, "
        "HDF5 or NetCDF file, the topic of a ROS 2 bag or MCAP file",
    )


class ChannelSettings(Table):
    """``[channels.NAME]``: where a channel comes from.

    The channel is ``sign * (reading + offset)``, converted from `unit` to SI: the offset is added
    to the reading, in the file's unit, before the sign.
    """

    column: str | None = Field(
        default=None, description="the column in the file; left out, the channel's own name"
    )
    instrument: str | None = Field(
        default=None, description="whose file holds it, where several files have such a column"
    )
    unit: str | None = Field(
        default=None, description="unit of the column, such as 'mm'; left out, the file's header"
    )
    unit_assumed: bool = Field(
        default=False, description="true while unit is a guess: prepare warns until it is removed"
    )
    sign: Literal[1, -1] = Field(default=1, description="1 or -1")
    offset: Finite = Field(
        default=0.0, description="added to the reading, in the file's unit, before the sign"
    )
    long_name: str | None = Field(default=None, description="name for labels")


class AlignmentSettings(Table):
    """``alignment`` of a model: the keys of :class:`seakeep.ProbeAlignment`."""

    mode: Literal["effective", "dispersion"] = Field(
        default="effective", description="'effective' (one celerity) or 'dispersion'"
    )
    surge: Literal["measured", "predicted", "none"] = Field(
        default="measured", description="'measured', 'predicted' or 'none'"
    )
    celerity: Positive | None = Field(
        default=None, description="m/s, of mode 'effective'; left out, it is estimated"
    )
    offset: Finite = Field(
        default=0.0, description="metres by which the elevation is carried, positive downstream"
    )
    surge_channel: str = Field(default="surge", description="the channel of the surge")
    channels: Names | None = Field(
        default=None, description="list of the inputs that are elevations"
    )
    highest_frequency: Positive | None = Field(
        default=None, description="Hz, of mode 'dispersion'; left out, it is estimated"
    )

    @model_validator(mode="after")
    def _keys_fit_mode(self) -> AlignmentSettings:
        for key, mode in (("celerity", "effective"), ("highest_frequency", "dispersion")):
            if getattr(self, key) is not None and self.mode != mode:
                raise ValueError(f"'{key}' goes with mode = '{mode}' alone; remove it")
        return self


class RunSettings(Table):
    """``[runs.NAME]``: one run, its file or files, and what it serves for.

    `file` where one file holds all channels, else `files`, one an instrument. Either `role` (with
    an optional `span`, the part that is used), or `train` and `test`, spans of one run that is
    used for both. `record` cuts the files before anything else is done with them.
    """

    file: str | None = Field(default=None, description="the file, relative to the campaign file")
    files: dict[str, str] = Field(
        default_factory=dict, description="instrument = its file, relative to the campaign file"
    )
    sea_state: str = Field(default="", description="a name for the sea state")
    waves: Literal["regular", "irregular"] | None = Field(
        default=None, description="'regular' or 'irregular'"
    )
    role: Literal["train", "test", "unused"] | None = Field(
        default=None, description="'train', 'test' or 'unused'"
    )
    span: Span | None = Field(
        default=None, description="[begin, end] in s or periods ('10 T'): the part used"
    )
    train: Span | None = Field(
        default=None, description="[begin, end] in s or periods, used for training"
    )
    test: Span | None = Field(
        default=None, description="[begin, end] in s or periods, used for testing"
    )
    record: Span | None = Field(
        default=None, description="[begin, end] in s or periods: the part read"
    )
    channels: dict[str, ChannelSettings] = Field(
        default_factory=dict, description="keys of [channels.NAME] that differ in this run"
    )
    probe_offset: Finite | None = Field(
        default=None,
        description="metres by which this run's elevations are carried, positive downstream",
    )
    probe_offset_span: Span | None = Field(
        default=None,
        description="[begin, end] in s or periods, from which a model estimates the offset",
    )

    @model_validator(mode="after")
    def _one_use(self) -> RunSettings:
        if (self.file is None) == (not self.files):
            raise ValueError(
                "a run needs either 'file', relative to the campaign file, or 'files', a table of "
                "one file an instrument"
            )
        if self.role is not None and (self.train or self.test):
            raise ValueError(
                "'role' does not go with 'train' and 'test'; state the role and 'span', or the "
                "two spans"
            )
        if self.probe_offset is not None and self.probe_offset_span is not None:
            raise ValueError("state 'probe_offset' or 'probe_offset_span', not both")
        return self


def _in_order(bounds: tuple[float, float]) -> tuple[float, float]:
    if not (math.isfinite(bounds[0]) and math.isfinite(bounds[1]) and bounds[0] < bounds[1]):
        raise ValueError("the bounds are [low, high], two finite numbers with low below high")
    return bounds


Bounds = Annotated[tuple[float, float], Field(strict=False), AfterValidator(_in_order)]


class PriorSettings(Table):
    """A prior of the ensemble, such as ``{ uniform = [10, 30] }``."""

    uniform: Bounds | None = Field(default=None, description="[low, high]")
    log_uniform: Bounds | None = Field(default=None, description="[low, high], both positive")
    fixed: Finite | None = Field(default=None, description="a number")
    distribution: str | None = Field(
        default=None, description="name of a distribution of scipy.stats, such as 'norm'"
    )
    parameters: dict[str, Finite] = Field(
        default_factory=dict,
        description="of that distribution, such as { loc = 1.0, scale = 0.1 }",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> PriorSettings:
        kinds = ("uniform", "log_uniform", "fixed", "distribution")
        if sum(getattr(self, kind) is not None for kind in kinds) != 1:
            raise ValueError(
                "a prior is one of { uniform = [a, b] }, { log_uniform = [a, b] }, "
                "{ fixed = value }, { distribution = 'name', parameters = { … } }"
            )
        if self.log_uniform is not None and self.log_uniform[0] <= 0:
            raise ValueError("'log_uniform' needs positive bounds; logarithms start above zero")
        if self.distribution is not None:
            self._check_distribution()
        elif self.parameters:
            raise ValueError("'parameters' go with 'distribution'; remove them")
        return self

    def _check_distribution(self) -> None:
        from scipy import stats

        found = getattr(stats, str(self.distribution), None)
        if not isinstance(found, stats.rv_continuous | stats.rv_discrete):
            known = [
                name
                for name in dir(stats)
                if isinstance(getattr(stats, name), stats.rv_continuous | stats.rv_discrete)
            ]
            raise ValueError(
                f"scipy.stats has no distribution '{self.distribution}'."
                f"{did_you_mean(str(self.distribution), known)} Name another one"
            )
        try:
            median = float(found(**self.parameters).ppf(0.5))
        except TypeError:
            shapes = f"{found.shapes}, loc, scale" if found.shapes else "loc, scale"
            stated = ", ".join(self.parameters) or "none"
            raise ValueError(
                f"'parameters' of '{found.name}' are {shapes}, of which loc and scale may be left "
                f"out; stated: {stated}"
            ) from None
        if not math.isfinite(median):
            raise ValueError(f"'{found.name}' with these 'parameters' has no median; correct them")


def _branch(value: object) -> str:
    return "<prior>" if isinstance(value, dict | PriorSettings) else "<number>"


NumberOrPrior = Annotated[
    Annotated[float, Field(ge=0, allow_inf_nan=False), Tag("<number>")]
    | Annotated[PriorSettings, Tag("<prior>")],
    Discriminator(_branch),
]
_ONE_MODEL = ("state_delays", "input_delays", "window")
_ENSEMBLE = (
    *("train_length", "state_delay", "input_delay"),
    *("n_members", "seed", "sampling", "train_on"),
)


class ModelSettings(Table):
    """``[model]`` and ``[models.NAME]``: states, inputs, and the constructor's own keys.

    Keys that are left out are None: the preset, or the constructor, decides about them.
    """

    kind: Literal["hankel_dmdc", "bayesian_hankel_dmdc"] = Field(
        default="hankel_dmdc", description="'hankel_dmdc' or 'bayesian_hankel_dmdc'"
    )
    preset: Literal["paper", "recommended"] | None = Field(
        default=None, description="'paper' or 'recommended'"
    )
    states: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] = Field(
        description="list of channels that the model forecasts"
    )
    inputs: Names = Field(default=(), description="list of channels that drive the model")
    state_delays: Samples | None = Field(
        default=None, description="samples, or periods such as '1 T'"
    )
    input_delays: Samples | None = Field(
        default=None, description="samples, or periods such as '5 T'"
    )
    ridge: NumberOrPrior | None = Field(
        default=None, description="a number, 0 or more; a prior for an ensemble"
    )
    window: Window | None = Field(
        default=None, description="training snapshots a run, or periods such as '20 T'"
    )
    history: Literal["before", "inside"] | None = Field(default=None, description="")
    delay_rows: Literal["ridge", "exact"] | None = Field(default=None, description="")
    ridge_scale: Literal["absolute", "per_snapshot"] | None = Field(default=None, description="")
    rank: Annotated[int, Field(ge=1)] | None = Field(default=None, description="a positive integer")
    standardize: bool | None = Field(default=None, description="true or false")
    precision: Literal["double", "single"] | None = Field(
        default=None, description="'double' or 'single'"
    )
    stop: Instant | None = Field(
        default=None, description="end of the training window, s or periods such as '60 T'"
    )
    alignment: AlignmentSettings | None = Field(
        default=None, description="a table, such as { mode = 'dispersion', surge = 'predicted' }"
    )
    train_length: NumberOrPrior | None = Field(
        default=None, description="a prior or a number, in encounter periods; for an ensemble"
    )
    state_delay: NumberOrPrior | None = Field(
        default=None, description="a prior or a number, in encounter periods; for an ensemble"
    )
    input_delay: NumberOrPrior | None = Field(
        default=None, description="a prior or a number, in encounter periods; for an ensemble"
    )
    n_members: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="number of members of an ensemble"
    )
    seed: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="an integer, 0 or more; for an ensemble"
    )
    sampling: Literal["monte_carlo", "sobol"] | None = Field(
        default=None, description="'monte_carlo' or 'sobol'; for an ensemble"
    )
    train_on: Literal["all", "runs", "windows"] | None = Field(
        default=None,
        description="what a member learns from: 'all' runs, one of the 'runs', or one of their "
        "'windows'; for an ensemble",
    )

    @model_validator(mode="after")
    def _keys_fit_kind(self) -> ModelSettings:
        foreign: tuple[str, ...] = _ENSEMBLE
        meant = "bayesian_hankel_dmdc"
        if self.kind == "bayesian_hankel_dmdc":
            foreign, meant = _ONE_MODEL, "hankel_dmdc"
        if given := [key for key in foreign if getattr(self, key) is not None]:
            raise ValueError(
                f"'{given[0]}' belongs to kind = '{meant}', not to '{self.kind}'; remove it or "
                "change the kind"
            )
        if self.kind == "hankel_dmdc" and isinstance(self.ridge, PriorSettings):
            raise ValueError("'ridge' of kind = 'hankel_dmdc' is a number, not a prior")
        for key in ("states", "inputs"):
            names = getattr(self, key)
            if len(set(names)) < len(names):
                raise ValueError(f"'{key}' names a channel twice; remove the repetition")
        if both := set(self.states) & set(self.inputs):
            raise ValueError(f"{sorted(both)[0]!r} is among the states and the inputs; choose one")
        return self

    def arguments(self) -> dict[str, Any]:
        """Keys of the constructor and of ``fit`` that the file states, without the channels.

        Returns
        -------
        dict
            Key → value; `kind`, `preset`, `states` and `inputs` are left out.

        Examples
        --------
        >>> ModelSettings(states=("heave",), ridge=100.0).arguments()
        {'ridge': 100.0}
        """
        apart = {"kind", "preset", "states", "inputs"}
        stated = {
            key: getattr(self, key)
            for key in type(self).model_fields
            if key not in apart and getattr(self, key) is not None
        }
        if self.alignment is not None:
            stated["alignment"] = self.alignment.model_dump()
        return stated


class CampaignSettings(Table):
    """A whole campaign file."""

    campaign: GeneralSettings = GeneralSettings()
    rig: RigSettings = RigSettings()
    files: FileSettings = FileSettings()
    channels: dict[str, ChannelSettings] = Field(
        min_length=1, description="at least one table [channels.NAME]"
    )
    derived: dict[str, DerivedSettings] = Field(default_factory=dict)
    instruments: InstrumentsSettings = InstrumentsSettings()
    redundant: dict[str, RedundantSettings] = Field(default_factory=dict)
    runs: dict[RunName, RunSettings] = Field(
        min_length=1, description="at least one table [runs.NAME] with a file"
    )
    preparation: PreparationSettings = PreparationSettings()
    model: ModelSettings | None = None
    models: dict[str, ModelSettings] = Field(default_factory=dict)

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
        waves = [name for name in (*inputs, *self.channel_names) if name.startswith("eta_")]
        return next(iter((*waves, *inputs)), None)

    @property
    def period_runs(self) -> tuple[str, ...]:
        """Runs over which the period is measured: irregular ones, or all if none is marked."""
        used = [name for name, run in self.runs.items() if run.role != "unused"]
        irregular = [name for name in used if self.runs[name].waves == "irregular"]
        return tuple(irregular or used)

    def all_models(self) -> dict[str, ModelSettings]:
        """Models by the key of their table: ``model`` and ``models.NAME``."""
        unnamed = {} if self.model is None else {"model": self.model}
        return {**unnamed, **{f"models.{name}": each for name, each in self.models.items()}}


def long_name_of(name: str, stated: str | None) -> str:
    """Label of a channel: the one stated, the canonical one, or the name with spaces."""
    canonical = canonical_channel(name)
    return stated or (canonical.long_name if canonical else name.replace("_", " "))
