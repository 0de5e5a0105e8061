"""Settings of the virtual tank, read from TOML and validated before anything runs."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from seakeep.errors import RequestError, did_you_mean

__all__ = [
    "ClockSettings",
    "DriftSettings",
    "FacilitySettings",
    "HullSettings",
    "InstrumentSettings",
    "LineSettings",
    "PoolGeometry",
    "RunSettings",
    "SimulationSettings",
    "SpectrumSettings",
    "TankSettings",
    "VesselSettings",
    "default_settings",
    "read_settings",
]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Pair = tuple[Positive, Positive]
Logger = Literal["wave_probes", "mru", "loads", "video"]


class _Settings(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class PoolGeometry(_Settings):
    """Moon pool: a basin at the free surface above a shelf, a narrower opening below it (m)."""

    centre: float = -0.09
    length: Positive = 0.45
    beam: Positive = 0.36
    bottom_length: Positive = 0.36
    bottom_beam: Positive = 0.28
    shelf: Annotated[float, Field(lt=0)] = -0.035
    lid: Annotated[float, Field(lt=0)] = -0.01

    @model_validator(mode="after")
    def _nested(self) -> PoolGeometry:
        if self.bottom_length > self.length or self.bottom_beam > self.beam:
            raise ValueError("the pool's bottom opening must fit inside its free surface")
        if self.shelf >= self.lid:
            raise ValueError("the pool's shelf must lie below its lid")
        return self


def _no_pool(value: object) -> object:
    return None if value is False else value


class HullSettings(_Settings):
    """Dimensions of the hull and the panels of its mesh; read by the mesh builder alone.

    ``pool = false`` in TOML is a hull without a moon pool.
    """

    mass: Positive = 60.7
    centre_of_gravity: float = 0.03
    pitch_gyradius: Positive = 0.36
    length_waterline: Positive = 1.34
    beam_waterline: Positive = 0.86
    waterplane_area: Positive = 0.9035
    bottom_taper: Annotated[float, Field(ge=0, lt=0.6)] = 0.3165
    pool: Annotated[PoolGeometry | None, BeforeValidator(_no_pool)] = PoolGeometry()
    internal_lid: Annotated[float, Field(lt=0)] = -0.005
    panels_along: Annotated[int, Field(ge=4)] = 14
    panels_across: Annotated[int, Field(ge=4)] = 10
    panels_down: Annotated[int, Field(ge=2)] = 5
    panels_bottom: Annotated[int, Field(ge=2)] = 4


class FacilitySettings(_Settings):
    """The tank: depth (m), what its wave maker can do, density of the water (kg/m³)."""

    water_depth: Positive = 3.6
    density: Positive = 1000.0
    wave_band: Pair = (0.1, 1.4)  # Hz
    greatest_height: Positive = 0.45  # m

    @model_validator(mode="after")
    def _ordered(self) -> FacilitySettings:
        if self.wave_band[0] >= self.wave_band[1]:
            raise ValueError("wave_band must be (low, high) in Hz with low < high")
        return self


class DampingSettings(_Settings):
    """Damping of the motions, linear or quadratic (SI)."""

    surge: NotNegative
    heave: NotNegative
    pitch: NotNegative


class PoolDampingSettings(_Settings):
    """Losses in the moon pool."""

    loss_coefficient: NotNegative = 1.5
    piston_linear: NotNegative = 12.0
    slosh_linear: NotNegative = 6.0
    slosh_quadratic: NotNegative = 40.0


class VesselSettings(_Settings):
    """Hydrodynamics file (empty: the one shipped), place in the tank (m), viscous damping."""

    hydrodynamics: str = ""
    position: Positive = 52.09
    linear_damping: DampingSettings = DampingSettings(surge=2.0, heave=10.0, pitch=1.0)
    quadratic_damping: DampingSettings = DampingSettings(surge=28.0, heave=650.0, pitch=40.0)
    pool: PoolDampingSettings = PoolDampingSettings()


class DriftSettings(_Settings):
    """Mean drift force ½ρgB·r/(1 + (corner/ω)⁴) a metre² of amplitude, and its damping."""

    beam: NotNegative = 0.86
    reflection: NotNegative = 0.75
    corner: Positive = 6.0
    damping: bool = True


class LineSettings(_Settings):
    """An elastic mooring line from an eye on the vessel to a pole.

    `eye`: x from the centre of gravity and height above still water (m); `pole`: distance from
    the wave maker and height above still water (m).
    """

    stiffness: Positive
    pretension: NotNegative
    damping: NotNegative = 0.15
    eye: tuple[float, float]
    pole: tuple[float, float]


class SimulationSettings(_Settings):
    """Time integration."""

    step: Positive = 0.01
    ramp: Positive = 10.0
    kernel_length: Positive = 12.0


class SpectrumSettings(_Settings):
    """A wave spectrum and how it is cut into components.

    `kind = "table"` takes `frequencies` (Hz) and `densities` (m²/Hz), or a `file` of two columns,
    comma-separated, with or without a line of headings.
    """

    kind: Literal["pierson_moskowitz", "jonswap", "table"] = "pierson_moskowitz"
    height: Positive | None = None
    peak_period: Positive | None = None
    peak_enhancement: Annotated[float, Field(ge=1, le=20)] = 3.3
    frequencies: tuple[Positive, ...] = ()
    densities: tuple[NotNegative, ...] = ()
    file: str = ""
    band: Pair = (0.28, 1.13)
    components: Annotated[int, Field(ge=1, le=20000)] = 100
    spacing: Literal["equal", "jittered"] = "jittered"

    @model_validator(mode="after")
    def _complete(self) -> SpectrumSettings:
        if self.band[0] >= self.band[1]:
            raise ValueError("band must be (low, high) in Hz with low < high")
        if self.kind == "table":
            if len(self.frequencies) != len(self.densities) or len(self.frequencies) < 2:
                raise ValueError(
                    "a spectrum given as a table needs as many frequencies (Hz) as densities "
                    f"(m²/Hz), two at least; received {len(self.frequencies)} and "
                    f"{len(self.densities)}"
                )
            if any(b <= a for a, b in zip(self.frequencies, self.frequencies[1:], strict=False)):
                raise ValueError("the frequencies of a spectrum must increase")
        elif self.height is None or self.peak_period is None:
            raise ValueError(f"a {self.kind} spectrum needs height (m) and peak_period (s)")
        return self


class RunSettings(_Settings):
    """One run: an irregular sea (a spectrum) or a regular wave (length and height)."""

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
    def _one_kind(self) -> RunSettings:
        regular = self.wavelength is not None and self.height is not None
        if (self.spectrum is None) != regular or (self.wavelength is None) != (self.height is None):
            raise ValueError(
                "a run needs either a spectrum (irregular) or wavelength and height (regular)"
            )
        return self

    @property
    def irregular(self) -> bool:
        """Whether the run has a spectrum."""
        return self.spectrum is not None


class ClockSettings(_Settings):
    """Rate of a logger (Hz), its clock's offset (s) and drift (parts per million)."""

    rate: Positive
    offset: float = 0.0
    drift: Annotated[float, Field(gt=-1e4, lt=1e4)] = 0.0


class ProbeSettings(_Settings):
    """A wave probe: distance from the wave maker (m), noise (m), share of time in drop-outs."""

    position: Positive
    noise: NotNegative
    dropouts: Annotated[float, Field(ge=0, lt=0.5)] = 0.0


class SlapSettings(_Settings):
    """Pulses on a load cell when its line is immersed or emerges (mean N, Hz, s)."""

    mean: NotNegative
    frequency: Pair = (2.0, 6.0)
    decay: Pair = (0.06, 0.25)


class InstrumentSettings(_Settings):
    """Instruments: probes, MRU, load cells, video, their noise (SI, radians) and clocks."""

    probes: dict[str, ProbeSettings]
    slap: dict[str, SlapSettings] = {}
    second_order: bool = True
    acceleration_noise: NotNegative = 0.03
    rate_noise: NotNegative = 0.002618
    angle_noise: NotNegative = 0.00087266
    heave_noise: NotNegative = 0.0008
    surge_noise: NotNegative = 0.006
    load_noise: NotNegative = 0.03
    trigger_period: Positive = 20.0
    trigger_width: Positive = 0.5
    clocks: dict[Logger, ClockSettings]

    @model_validator(mode="after")
    def _complete(self) -> InstrumentSettings:
        missing = {"wave_probes", "mru", "loads", "video"} - set(self.clocks)
        if missing:
            raise ValueError(f"the clocks of {', '.join(sorted(missing))} are missing")
        if self.trigger_width >= self.trigger_period:
            raise ValueError("trigger_width must be shorter than trigger_period")
        return self


class TankSettings(_Settings):
    """All settings of a virtual campaign."""

    name: str = "virtual towing tank"
    seed: Annotated[int, Field(ge=0)] = 0
    scale_factor: Positive = 50.0
    facility: FacilitySettings = FacilitySettings()
    hull: HullSettings = HullSettings()
    vessel: VesselSettings = VesselSettings()
    drift: DriftSettings = DriftSettings()
    moorings: dict[str, LineSettings]
    simulation: SimulationSettings = SimulationSettings()
    instruments: InstrumentSettings
    runs: dict[str, RunSettings]
    folder: str = ""

    @property
    def hydrodynamics_path(self) -> Path | None:
        """The hydrodynamics file, or None for the one that ships with the package."""
        if not self.vessel.hydrodynamics:
            return None
        return Path(self.folder) / self.vessel.hydrodynamics


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    """Field names of the model at a location of the settings."""
    model: Any = TankSettings
    for part in location:
        if isinstance(model, type) and issubclass(model, BaseModel):
            field = model.model_fields.get(str(part))
            model = None if field is None else field.annotation
        else:
            model = _value_type(model)
        model = _model_in(model)
    if isinstance(model, type) and issubclass(model, BaseModel):
        return list(model.model_fields)
    return []


def _model_in(annotation: Any) -> Any:
    """The settings class in an optional annotation, or the annotation itself."""
    for part in getattr(annotation, "__args__", ()):
        if isinstance(part, type) and issubclass(part, BaseModel) and len(annotation.__args__) == 2:
            origin = getattr(annotation, "__origin__", None)
            return annotation if origin is dict else part
    return annotation


def _value_type(annotation: Any) -> Any:
    arguments = getattr(annotation, "__args__", ())
    return arguments[-1] if arguments else None


def _explain(error: ValidationError, source: str) -> RequestError:
    lines = []
    for item in error.errors():
        *parents, last = item["loc"] or ("",)
        where = ".".join(str(part) for part in item["loc"]) or "the settings"
        if item["type"] == "extra_forbidden":
            near = did_you_mean(str(last), _known_keys(tuple(parents)))
            lines.append(f"{where} is not a setting.{near} Correct or remove the key.")
        elif item["type"] == "missing":
            lines.append(f"{where} is missing. Add the key.")
        else:
            message = item["msg"].removeprefix("Value error, ")
            shown = "" if isinstance(item["input"], dict) else f"; received {item['input']!r}"
            lines.append(f"{where}: {message[0].lower()}{message[1:]}{shown}. Correct the value.")
    return RequestError(f"{source}: " + "\n".join(lines))


def validate_settings(table: dict[str, Any], source: str = "the tank settings") -> TankSettings:
    """Validate a table of settings.

    Parameters
    ----------
    table : dict
        As read from TOML.
    source : str, optional
        Name for the messages.

    Returns
    -------
    TankSettings
        The settings.

    Raises
    ------
    RequestError
        If a key is unknown or a value out of range; the message names key, value and mend.
    """
    try:
        return TankSettings.model_validate(table)
    except ValidationError as error:
        raise _explain(error, source) from error


def read_settings(path: Path | str) -> TankSettings:
    """Read settings from a TOML file; tables that it leaves out are the CK-14e's.

    Parameters
    ----------
    path : path
        TOML file. The table ``[runs]``, ``[moorings]`` or ``[instruments.probes]`` replaces the
        default one as a whole; other tables are completed key by key.

    Returns
    -------
    TankSettings
        The settings; relative paths in them start at the file's folder.

    Raises
    ------
    RequestError
        If the file does not exist, is not TOML, or holds a wrong setting.
    """
    source = Path(path)
    try:
        table = tomllib.loads(source.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise RequestError(
            f"the settings file {source} does not exist. Correct the path."
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise RequestError(f"{source} is not valid TOML: {error}. Correct that line.") from error
    merged = _merge(_default_table(), table, ())
    for name, run in merged["runs"].items():
        spectrum = run.get("spectrum") if isinstance(run, dict) else None
        if isinstance(spectrum, dict) and spectrum.get("file"):
            run["spectrum"] = _with_file(spectrum, source.parent, f"{source}: runs.{name}")
    merged["folder"] = str(source.parent)
    return validate_settings(merged, str(source))


def _with_file(spectrum: dict[str, Any], folder: Path, where: str) -> dict[str, Any]:
    """Fill a spectrum's table from its file."""
    path = folder / str(spectrum["file"])
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise RequestError(
            f"{where}.spectrum.file: {path} cannot be read ({error.strerror}). Correct the path, "
            "relative to the settings file."
        ) from error
    rows = [line.split(",") for line in lines if line.strip() and not line.startswith("#")]
    if rows and not _is_number(rows[0][0]):
        rows = rows[1:]
    for number, row in enumerate(rows, 1):
        if len(row) != 2 or not all(map(_is_number, row)):
            raise RequestError(
                f"{where}.spectrum.file: row {number} of {path} is {','.join(row)!r}; two numbers "
                "are needed, frequency (Hz) and density (m²/Hz), with a comma between."
            )
    frequencies, densities = ([float(row[i]) for row in rows] for i in (0, 1))
    return {"kind": "table", **spectrum, "frequencies": frequencies, "densities": densities}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


_REPLACED = {("runs",), ("moorings",), ("instruments", "probes"), ("instruments", "slap")}


def _merge(base: dict[str, Any], over: dict[str, Any], trail: tuple[str, ...]) -> dict[str, Any]:
    result = dict(base)
    for key, value in over.items():
        here = (*trail, key)
        if isinstance(value, dict) and isinstance(base.get(key), dict) and here not in _REPLACED:
            result[key] = _merge(base[key], value, here)
        else:
            result[key] = value
    return result


def _default_table() -> dict[str, Any]:
    text = resources.files("seakeep.tank").joinpath("data", "ck14e.toml").read_text("utf-8")
    return tomllib.loads(text)


def default_settings() -> TankSettings:
    """Return the paper's campaign: a CK-14e-like vessel in three irregular and three regular seas.

    Examples
    --------
    >>> settings = default_settings()
    >>> sorted(settings.runs)[:3]
    ['irregular_1', 'irregular_2', 'irregular_3']
    """
    return validate_settings(_default_table())
