"""Settings of the virtual tank: the tables of its TOML file, SI units and radians.

The default numbers stand, with their units and reasons, in ``data/ck14e.toml``.
"""

from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from seakeep.arrays import Json
from seakeep.campaign.settings import Band, ChannelName, RunName
from seakeep.errors import RequestError
from seakeep.files import read_bytes
from seakeep.toml import (
    Count,
    Finite,
    Listed,
    NotNegative,
    Pair,
    Positive,
    Table,
    packaged,
    read_toml,
    validated,
)

DEFAULT = "tank/data/ck14e.toml"
Logger = Literal["wave_probes", "mru", "loads", "video"]
Point = Annotated[tuple[Finite, Finite], Listed]
Depth = Annotated[float, Field(ge=0.01, le=1e4, description="a depth of 0.01 to 10 000 m")]


class LineSettings(Table):
    """A line from an eye on the vessel to a pole: a spring that only pulls.

    `eye`: x from the centre of gravity and height above still water (m); `pole`: distance from
    the wave maker and height above still water (m). `damping` acts on the rate of the stretch.
    """

    stiffness: Positive
    pretension: NotNegative
    damping: NotNegative = 0.15
    eye: Point
    pole: Point


class FacilitySettings(Table):
    """The tank: depth (m), what its wave maker can do (Hz, m), density of the water (kg/m³)."""

    water_depth: Depth
    density: Positive
    wave_band: Band
    greatest_height: Positive


class DampingSettings(Table):
    """Damping of the motions, linear or quadratic."""

    surge: NotNegative
    heave: NotNegative
    pitch: NotNegative


class PoolDampingSettings(Table):
    """Losses in the moon pool."""

    loss_coefficient: NotNegative
    piston_linear: NotNegative
    slosh_linear: NotNegative
    slosh_quadratic: NotNegative


class VesselSettings(Table):
    """Hydrodynamics file (empty: the one shipped), place in the tank (m), viscous damping."""

    hydrodynamics: str
    position: Positive
    linear_damping: DampingSettings
    quadratic_damping: DampingSettings
    pool: PoolDampingSettings


class DriftSettings(Table):
    """Drift force: its law, a factor on what energy and momentum allow, and its damping."""

    law: Literal["newman", "qtf"] = "newman"
    scale: NotNegative = 1.0
    damping: bool = True


class SimulationSettings(Table):
    """Time integration (s)."""

    step: Positive
    ramp: Positive
    kernel_length: Positive


class SpectrumSettings(Table):
    """A wave spectrum and how it is cut into components.

    ``kind = "table"`` takes `frequencies` (Hz) and `densities` (m²/Hz), or a `file` of two columns,
    comma-separated, with or without a line of headings.
    """

    kind: Literal["pierson_moskowitz", "jonswap", "table"] = "pierson_moskowitz"
    height: Positive | None = None
    peak_period: Positive | None = None
    peak_enhancement: Annotated[float, Field(ge=1, le=20)] = 3.3
    frequencies: Annotated[tuple[Positive, ...], Listed] = ()
    densities: Annotated[tuple[NotNegative, ...], Listed] = ()
    file: str = ""
    band: Band = (0.28, 1.13)
    components: Count = 100
    spacing: Literal["equal", "jittered"] = "jittered"

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.kind != "table":
            if not (self.height and self.peak_period):
                raise ValueError(f"a {self.kind} spectrum needs height (m) and peak_period (s)")
            return self
        counts = len(self.frequencies), len(self.densities)
        if counts[0] != counts[1] or counts[0] < 2:
            raise ValueError(
                "a spectrum given as a table needs as many frequencies (Hz) as densities (m²/Hz), "
                f"two at least; there are {counts[0]} and {counts[1]}"
            )
        if np.any(np.diff(self.frequencies) <= 0):
            raise ValueError("the frequencies of a spectrum must increase")
        return self


class RunPlan(Table):
    """One run: an irregular sea (a spectrum) or a regular wave (length and height, m); s."""

    spectrum: SpectrumSettings | None = None
    wavelength: Positive | None = None
    height: Positive | None = None
    nominal_height: Positive | None = None
    unsteadiness: Annotated[float, Field(ge=0, le=0.5)] = 0.04
    startup: NotNegative = 60.0
    duration: Positive = 210.0
    role: Literal["train", "test", "both"] = "both"
    sea_state: str = ""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        is_regular = {self.spectrum is None, self.wavelength is not None, self.height is not None}
        if len(is_regular) > 1:
            raise ValueError(
                "a run needs either a spectrum (irregular) or wavelength and height (regular)"
            )
        return self

    @property
    def length(self) -> float:
        """Start-up and record, s."""
        return self.startup + self.duration


class ClockSettings(Table):
    """Rate of a logger (Hz), its clock's offset (s) and drift (parts per million)."""

    rate: Positive
    offset: Finite = 0.0
    drift: Finite = 0.0


class ProbeSettings(Table):
    """A wave probe: distance from the wave maker (m), noise (m), share of time in drop-outs."""

    position: Positive
    noise: NotNegative
    dropouts: Annotated[float, Field(ge=0, lt=0.5)] = 0.0


class SlapSettings(Table):
    """Pulses on a load cell when its line is immersed or emerges (mean N, Hz, s)."""

    mean: NotNegative
    frequency: Pair = (2.0, 6.0)
    decay: Pair = (0.06, 0.25)


class InstrumentPlan(Table):
    """Instruments: probes, MRU, load cells, video, their noise (SI, radians) and clocks."""

    probes: dict[ChannelName, ProbeSettings]
    slap: dict[str, SlapSettings] = Field(default_factory=dict)
    second_order: bool
    acceleration_noise: NotNegative
    rate_noise: NotNegative
    angle_noise: NotNegative
    heave_noise: NotNegative
    surge_noise: NotNegative
    load_noise: NotNegative
    trigger_period: Positive
    trigger_width: Positive
    clocks: dict[Logger, ClockSettings]

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.trigger_width >= self.trigger_period:
            raise ValueError("trigger_width must be shorter than trigger_period")
        return self


class TankSettings(Table):
    """All settings of a virtual campaign."""

    name: str
    seed: Annotated[int, Field(ge=0, lt=2**64, description="a number from 0 to 2^64 − 1")]
    scale_factor: Positive
    facility: FacilitySettings
    hull: Json  # dimensions and mesh; tools/build_hydrodynamics.py alone reads them
    vessel: VesselSettings
    drift: DriftSettings
    moorings: dict[ChannelName, LineSettings]
    simulation: SimulationSettings
    instruments: InstrumentPlan
    runs: dict[RunName, RunPlan]


def read_tank(path: Path | str) -> TankSettings:
    """Read settings from a TOML file; tables that it leaves out are the CK-14e's.

    Parameters
    ----------
    path : path
        TOML file. The table ``[runs]``, ``[moorings]`` or ``[instruments.probes]`` replaces the
        default one as a whole; other tables are completed key by key. Paths in it start at its
        folder.

    Returns
    -------
    TankSettings
        The settings.

    Raises
    ------
    RequestError
        If the file does not exist, is not TOML, or holds a wrong setting.
    """
    source = Path(path)
    merged = _merge(packaged(DEFAULT), read_toml(source, "tank"), ())
    for name, run in merged["runs"].items() if isinstance(merged["runs"], dict) else ():
        spectrum = run.get("spectrum") if isinstance(run, dict) else None
        if isinstance(spectrum, dict) and spectrum.get("file"):
            place = source.parent / str(spectrum["file"])
            run["spectrum"] = {**spectrum, **_spectrum_of(place, f"{source}: runs.{name}")}
    vessel = merged["vessel"]
    if isinstance(vessel, dict) and vessel["hydrodynamics"]:
        vessel["hydrodynamics"] = str(source.parent / str(vessel["hydrodynamics"]))
    return validated(TankSettings, merged, source, "tank")


def _spectrum_of(path: Path, where: str) -> Json:
    """Keys of a spectrum from a file of two columns."""
    try:
        text = read_bytes(path).decode("utf-8").strip()
        heading = not text.lstrip("+.")[:1].isdigit()
        lines = text.splitlines()[heading:]
        frequencies, densities = np.loadtxt(lines, delimiter=",", ndmin=2, unpack=True)
    except ValueError as error:  # of our own too, where the file is missing
        raise RequestError(
            f"{where}.spectrum.file: {path} cannot be read ({error}). Two columns of numbers are "
            "needed, frequency (Hz) and density (m²/Hz), with a comma between; the path is "
            "relative to the settings file."
        ) from error
    return {"kind": "table", "frequencies": frequencies.tolist(), "densities": densities.tolist()}


_REPLACED = {("runs",), ("moorings",), ("instruments", "probes"), ("instruments", "slap")}


def _merge(base: Json, over: Json, trail: tuple[str, ...]) -> Json:
    """Complete a table by the default one."""
    result = dict(base)
    for key, value in over.items():
        here = (*trail, key)
        if isinstance(value, dict) and isinstance(base.get(key), dict) and here not in _REPLACED:
            value = _merge(base[key], value, here)
        result[key] = value
    return result


def with_waves(
    settings: TankSettings, seed: int | None, spacing: str | None = None
) -> TankSettings:
    """Return settings with another seed, or another spacing of the components of all spectra."""
    table = settings.model_dump()
    if seed is not None:
        table["seed"] = seed
    for run in table["runs"].values():
        if spacing and run["spectrum"]:
            run["spectrum"]["spacing"] = spacing
    return TankSettings.model_validate(table)


def default_settings() -> TankSettings:
    """Return the paper's campaign: a CK-14e-like vessel in three irregular and three regular seas.

    Examples
    --------
    >>> settings = default_settings()
    >>> sorted(settings.runs)[:3]
    ['irregular_1', 'irregular_2', 'irregular_3']
    """
    return TankSettings.model_validate(packaged(DEFAULT))
