"""Tables of the measurement chain: instruments, derived channels, redundancy, preparation."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, model_validator

from seakeep.campaign.tables import Band, Finite, Frequency, Interval, Names, Positive, Table

__all__ = [
    "DerivedSettings",
    "InstrumentSettings",
    "InstrumentsSettings",
    "PreparationSettings",
    "RedundantSettings",
]

TwoColumns = Annotated[tuple[str, str], Field(strict=False)]
Vector = Annotated[tuple[Finite, Finite, Finite], Field(strict=False)]


class InstrumentSettings(Table):
    """``[instruments.NAME]``: a logger with a file of its own in each run, and its clock.

    The clock is found from a trigger that the reference records too, from a signal that both
    hold (`shared`), or from two that go together (`correlated`); without these it is `offset` and
    `drift` as stated, or the reference's own clock.
    """

    sampling_rate: Positive | None = Field(
        default=None, description="samples a second; times are counted where the file has none"
    )
    sampling_rate_assumed: bool = Field(
        default=False,
        description="true while sampling_rate is a guess: prepare warns until it is removed",
    )
    time: str | None = Field(default=None, description="the name of its time column")
    time_unit: str | None = Field(default=None, description="unit of its time column, such as 'ms'")
    trigger: str | None = Field(default=None, description="the column that holds the trigger")
    trigger_unit: str | None = Field(default=None, description="unit of the trigger, for the eye")
    shared: TwoColumns | None = Field(
        default=None, description="[own column, reference's column] of one signal both record"
    )
    correlated: TwoColumns | None = Field(
        default=None, description="[own column, reference's column] of signals that go together"
    )
    window: Interval = Field(
        default=20.0, description="length of correlation windows, s or periods"
    )
    largest_lag: Interval = Field(
        default=5.0, description="lags searched on either side, s or periods"
    )
    offset: Finite | None = Field(
        default=None, description="reading of its clock at reference time 0, s"
    )
    drift: Finite | None = Field(default=None, description="drift of its clock, ppm")
    metres_per_pixel: Positive | None = Field(
        default=None, description="of a camera, in the vessel's plane"
    )
    panel: Annotated[tuple[Positive, Positive], Field(strict=False)] | None = Field(
        default=None, description="[length, height] of the panel that a camera tracks, m"
    )
    panel_height: Finite | None = Field(
        default=None, description="of the panel's centre above the centre of gravity, m"
    )

    @model_validator(mode="after")
    def _one_way(self) -> InstrumentSettings:
        given = [k for k in ("trigger", "shared", "correlated") if getattr(self, k) is not None]
        if len(given) > 1:
            raise ValueError(f"state only one of {', '.join(given)} to find the clock from")
        return self


class InstrumentsSettings(Table):
    """``[instruments]``: whose clock is time, and a table for each logger."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)
    __pydantic_extra__: dict[str, InstrumentSettings] = Field(init=False)

    reference: str | None = Field(
        default=None, description="the logger whose clock is the time of all; the first by default"
    )
    pool_drift: bool = Field(
        default=True, description="true: one drift a logger for all runs that agree"
    )

    @property
    def loggers(self) -> dict[str, InstrumentSettings]:
        """Tables of the loggers by name."""
        return dict(self.__pydantic_extra__ or {})

    def __getitem__(self, name: str) -> InstrumentSettings:
        """Settings of a logger; the default ones where it has no table."""
        return self.loggers.get(name, InstrumentSettings())


_STEP_KEYS: dict[str, set[str]] = {
    "band_pass": {"band"},
    "integrate": {"times", "band"},
    "differentiate": set(),
    "low_pass": {"passband", "stopband"},
    "envelope_squared": set(),
    "blend": {"times", "position", "crossover"},
    "transfer": {"offset", "axis"},
    "remove_gravity": {"axis", "components", "zeroed"},
}
_NEEDED = {
    "integrate": ("band", "(Hz), such as band = [0.3, 5.0]"),
    "band_pass": ("band", "(Hz), such as band = [0.3, 5.0]"),
    "low_pass": ("passband", "(Hz)"),
    "blend": ("position", "and 'crossover' (Hz), such as position = 'surge', crossover = 0.15"),
    "transfer": ("offset", "[x, y, z] (m) from the measured point to the wanted one"),
}
Step = Literal[
    "integrate", "differentiate", "band_pass", "low_pass", "envelope_squared",
    "blend", "transfer", "remove_gravity",
]  # fmt: skip


class DerivedSettings(Table):
    """``[derived.NAME]``: a channel made from others, by an expression or by a named step."""

    expression: str | None = Field(
        default=None, description="such as '0.5*(acc_sb + acc_ps)', on SI values"
    )
    source: str | None = Field(
        default=None, alias="from", description="the channel that the step works on"
    )
    step: Step | None = Field(
        default=None, description="what to do with the channel named by 'from'"
    )
    times: Literal[1, 2] | None = Field(default=None, description="integrate once or twice")
    band: Band | None = Field(
        default=None,
        description="[low, high] in Hz, or ['0.3 /T', '8 /T'], kept by 'integrate' and 'band_pass'",
    )
    passband: Frequency | None = Field(
        default=None,
        description="edge of the pass band, Hz, or per period such as '16 /T' (not on "
        "the channel on which the period is counted)",
    )
    stopband: Frequency | None = Field(
        default=None, description="edge of the stop band, Hz or per period"
    )
    position: str | None = Field(
        default=None, description="'blend': the measured position that gives the slow part"
    )
    crossover: Frequency | None = Field(
        default=None,
        description="'blend': where both count half, below the waves, Hz or per period",
    )
    offset: Vector | None = Field(
        default=None,
        description="'transfer': [x, y, z] from the measured to the wanted point, m, in the body's "
        "axes (x downstream, z up)",
    )
    axis: Literal["x", "y", "z"] | None = Field(
        default=None, description="direction of a channel that is not called surge, sway or heave"
    )
    components: Annotated[tuple[str, str, str], Field(strict=False)] | None = Field(
        default=None, description="'remove_gravity': accelerometers along x, y and z of the body"
    )
    zeroed: bool | None = Field(
        default=None,
        description="'remove_gravity': true where readings were set to zero at rest, false where "
        "the one along z reads +9.81 m/s^2 there",
    )
    unit: str | None = Field(
        default=None, description="unit of the result; needed by expressions for free names"
    )
    long_name: str | None = Field(default=None, description="name for labels")

    @model_validator(mode="after")
    def _one_way(self) -> DerivedSettings:
        if (self.expression is None) == (self.step is None):
            raise ValueError("a derived channel needs either 'expression', or 'from' and 'step'")
        keys = set().union(*_STEP_KEYS.values())
        given = {key for key in keys if getattr(self, key) is not None}
        if self.step is None:
            if self.source is not None or given:
                raise ValueError("'from' and the keys of steps do not go with 'expression'")
            return self
        if self.source is None:
            raise ValueError(f"step '{self.step}' needs 'from', the channel it works on")
        if extra := given - _STEP_KEYS[self.step]:
            raise ValueError(f"step '{self.step}' has no key {sorted(extra)[0]!r}; remove it")
        needed, words = _NEEDED.get(self.step, ("", ""))
        if needed and (needed not in given or (needed == "position" and not self.crossover)):
            raise ValueError(f"step '{self.step}' needs '{needed}' {words}")
        return self


class RedundantSettings(Table):
    """``[redundant.NAME]``: channels that measure one quantity; the first is trusted."""

    channels: Names = Field(description="two channels or more of one unit, the trusted one first")
    window: Interval | None = Field(
        default=None,
        description="length of the windows compared, s or periods; by default 4 dominant periods",
    )

    @model_validator(mode="after")
    def _several(self) -> RedundantSettings:
        if len(self.channels) < 2 or len(set(self.channels)) < len(self.channels):
            raise ValueError("redundant channels are two different ones or more")
        return self


class PreparationSettings(Table):
    """``[preparation]``: the common time step and how it is reached.

    The preset ``paper`` filters every channel that was sampled fast enough as the paper does
    (pass 10 Hz, stop 10.75 Hz, 60 dB) and then takes 32 samples a period without another filter;
    ``recommended`` filters below 0.8 of the new Nyquist frequency. Keys that are stated replace
    those of the preset.
    """

    preset: Literal["paper", "recommended"] | None = Field(
        default=None, description="'paper' or 'recommended'"
    )
    sampling_rate: Positive | None = Field(default=None, description="samples a second, Hz")
    dt: Positive | None = Field(default=None, description="time step in seconds")
    steps_per_period: Annotated[int, Field(ge=4)] | None = Field(
        default=None, description="samples a mean encounter period; 32 is the paper's"
    )
    attenuation: Annotated[float, Field(ge=50, le=200)] = Field(
        default=60.0, description="attenuation above the new Nyquist frequency, dB, at least 50"
    )
    low_pass: Band | None = Field(
        default=None,
        description="[pass, stop] in Hz or per period, of all channels sampled fast enough",
    )
    anti_alias: bool = Field(
        default=True, description="false: take samples without a filter at the new Nyquist"
    )
    gaps: Literal["refuse", "mask", "bridge"] = Field(
        default="refuse",
        description="'refuse': an error; 'mask': NaN where samples are missing; 'bridge': short "
        "gaps filled and flagged, NaN in the others",
    )
    longest_gap: Interval = Field(
        default=0.25, description="gaps that 'bridge' fills, s or periods"
    )
    jitter: Literal["refuse", "interpolate"] = Field(
        default="refuse", description="'refuse' or 'interpolate' times that are not uniform"
    )
    outliers: Literal["flag", "replace"] = Field(
        default="flag", description="'flag', or 'replace' by what is interpolated across them"
    )

    @model_validator(mode="before")
    @classmethod
    def _with_preset(cls, received: Any) -> Any:
        if isinstance(received, dict) and received.get("preset") in ("paper", "recommended"):
            chain: dict[str, Any] = {"anti_alias": received["preset"] == "recommended"}
            if received["preset"] == "paper":
                chain["low_pass"] = [10.0, 10.75]
            if not {"sampling_rate", "dt", "steps_per_period"} & set(received):
                chain["steps_per_period"] = 32
            return {**chain, **received}
        return received

    @model_validator(mode="after")
    def _one_rate(self) -> PreparationSettings:
        given = [k for k in ("sampling_rate", "dt", "steps_per_period") if getattr(self, k)]
        if len(given) > 1:
            raise ValueError(f"state only one of {', '.join(given)}")
        return self
