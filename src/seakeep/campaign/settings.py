"""What a campaign file may say: one frozen table a section, validated by pydantic.

Nothing is read from disk here; :mod:`seakeep.campaign.validation` fills these tables from TOML and
turns what does not fit into messages. A field's description is the mend that a message proposes.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from seakeep.campaign.chain_settings import (
    DerivedSettings,
    InstrumentSettings,
    InstrumentsSettings,
    PreparationSettings,
    RedundantSettings,
)
from seakeep.campaign.tables import Finite, Names, Positive, RunName, Span, Table
from seakeep.conventions import canonical_channel

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
    encoding: str | None = Field(default=None, description="such as 'utf-8' or 'latin-1'")
    group: str | None = Field(default=None, description="group of an HDF5 file")


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
    span: Span | None = Field(default=None, description="[begin, end] in s: the part used")
    train: Span | None = Field(default=None, description="[begin, end] in s, used for training")
    test: Span | None = Field(default=None, description="[begin, end] in s, used for testing")
    record: Span | None = Field(default=None, description="[begin, end] in s: the part read")
    channels: dict[str, ChannelSettings] = Field(
        default_factory=dict, description="keys of [channels.NAME] that differ in this run"
    )
    probe_offset: Finite | None = Field(
        default=None,
        description="metres by which this run's elevations are carried, positive downstream",
    )
    probe_offset_span: Span | None = Field(
        default=None, description="[begin, end] in s, from which a model estimates the offset"
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


class PriorSettings(Table):
    """A prior of the ensemble, such as ``{ uniform = [10, 30] }``."""

    uniform: Span | None = Field(default=None, description="[low, high]")
    log_uniform: Span | None = Field(default=None, description="[low, high], both positive")
    fixed: Finite | None = Field(default=None, description="a number")

    @model_validator(mode="after")
    def _one_kind(self) -> PriorSettings:
        if sum(getattr(self, k) is not None for k in ("uniform", "log_uniform", "fixed")) != 1:
            raise ValueError("a prior is one of { uniform = [a, b] }, { log_uniform = [a, b] }, "
                             "{ fixed = value }")  # fmt: skip
        return self


def _branch(value: object) -> str:
    return "<prior>" if isinstance(value, dict | PriorSettings) else "<number>"


NumberOrPrior = Annotated[
    Annotated[float, Field(ge=0, allow_inf_nan=False), Tag("<number>")]
    | Annotated[PriorSettings, Tag("<prior>")],
    Discriminator(_branch),
]
Delays = Annotated[int, Field(ge=0)]
_ONE_MODEL = ("state_delays", "input_delays", "window")
_ENSEMBLE = ("train_length", "state_delay", "input_delay", "n_members", "seed")


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
    state_delays: Delays | None = Field(default=None, description="samples")
    input_delays: Delays | None = Field(default=None, description="samples")
    ridge: NumberOrPrior | None = Field(
        default=None, description="a number, 0 or more; a prior for an ensemble"
    )
    window: Annotated[int, Field(ge=2)] | None = Field(
        default=None, description="training snapshots a run"
    )
    history: Literal["before", "inside"] | None = Field(default=None, description="")
    delay_rows: Literal["ridge", "exact"] | None = Field(default=None, description="")
    ridge_scale: Literal["absolute", "per_snapshot"] | None = Field(default=None, description="")
    rank: Annotated[int, Field(ge=1)] | None = Field(default=None, description="a positive integer")
    standardize: bool | None = Field(default=None, description="true or false")
    precision: Literal["double", "single"] | None = Field(
        default=None, description="'double' or 'single'"
    )
    stop: Finite | None = Field(default=None, description="end of the training window, s")
    alignment: AlignmentSettings | None = Field(
        default=None, description="a table, such as { mode = 'dispersion', surge = 'predicted' }"
    )
    train_length: PriorSettings | None = Field(default=None, description="a prior, in periods")
    state_delay: PriorSettings | None = Field(default=None, description="a prior, in periods")
    input_delay: PriorSettings | None = Field(default=None, description="a prior, in periods")
    n_members: Annotated[int, Field(ge=1)] | None = Field(default=None, description="members")
    seed: Annotated[int, Field(ge=0)] | None = Field(default=None, description="an integer")

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

    def all_models(self) -> dict[str, ModelSettings]:
        """Models by the key of their table: ``model`` and ``models.NAME``."""
        unnamed = {} if self.model is None else {"model": self.model}
        return {**unnamed, **{f"models.{name}": each for name, each in self.models.items()}}


def long_name_of(name: str, stated: str | None) -> str:
    """Label of a channel: the one stated, the canonical one, or the name with spaces."""
    canonical = canonical_channel(name)
    return stated or (canonical.long_name if canonical else name.replace("_", " "))
