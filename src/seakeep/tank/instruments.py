"""Instruments of the virtual tank: what each logger writes, in its own clock, with its noise.

A logger whose clock reads c(t) = offset + (1 + drift)·t at the reference time t samples at
uniform readings c. The 500 Hz logger of the wave probes is the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.arrays import FloatArray
from seakeep.tank.dynamics import Motion, Rig, tensions
from seakeep.tank.seas import Sea
from seakeep.tank.settings import (
    ClockSettings,
    InstrumentPlan,
    Logger,
    SlapSettings,
    TankSettings,
)

__all__ = ["Column", "Played", "Record", "clock_instants", "record_run", "slap_pulses", "trigger"]


TRIGGER_VOLTS = 5.0
TRIGGER_NOISE = 0.01  # V
LAMP_NOISE = 0.02
FIRST_PULSE = 10.0  # s


@dataclass(frozen=True)
class Column:
    """A column of a raw file: its unit, values, and decimals written."""

    unit: str
    values: FloatArray
    decimals: int


@dataclass(frozen=True)
class Record:
    """What one logger writes: the readings of its clock (s), and its columns."""

    name: str
    time: FloatArray
    columns: dict[str, Column]


@dataclass(frozen=True)
class Played:
    """A simulated run: the sea, the motion, and functions of time that instruments sample.

    The motion starts before and ends after the record, whose length is in seconds.
    """

    settings: TankSettings
    rig: Rig
    sea: Sea
    motion: Motion
    length: float

    def states(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration at any instants, each of shape (dof, time)."""
        m, smooth = self.motion, scipy.interpolate
        return (
            smooth.CubicHermiteSpline(m.time, m.position, m.velocity, axis=1)(time),
            smooth.CubicHermiteSpline(m.time, m.velocity, m.acceleration, axis=1)(time),
            smooth.CubicSpline(m.time, m.acceleration, axis=1)(time),
        )

    def ramp(self, time: FloatArray) -> FloatArray:
        """Part of their height to which the waves have grown, shape (time,)."""
        elapsed = np.clip((time - self.motion.time[0]) / self.rig.ramp, 0.0, 1.0)
        grown: FloatArray = 0.5 * (1.0 - np.cos(np.pi * elapsed))
        return grown

    def elevation(self, place: npt.ArrayLike, time: FloatArray) -> FloatArray:
        """Linear elevation at a place in the tank (m from the wave maker), m."""
        x = np.asarray(place, dtype=float) - self.settings.vessel.position
        return self.ramp(time) * self.sea.elevation(x, time)

    def crest(self, place: float, time: FloatArray) -> FloatArray:
        """Second-order part of the elevation at a fixed place, ½k(η² − η_H²), m."""
        analytic = self.sea.analytic(place - self.settings.vessel.position, time)
        squared: FloatArray = np.real(analytic**2) * self.ramp(time) ** 2
        return 0.5 * self.sea.mean_wavenumber * squared

    def loads(self, time: FloatArray) -> FloatArray:
        """Tension of each line without slap or noise, N, shape (line, time)."""
        position, velocity, _ = self.states(time)
        return tensions(self.rig, position, velocity)


def clock_instants(clock: ClockSettings, length: float) -> tuple[FloatArray, FloatArray]:
    """Readings of a logger's clock over its record, and the reference instants of them, s.

    Examples
    --------
    >>> readings, instants = clock_instants(ClockSettings(rate=50.0, offset=0.37), 1.0)
    >>> float(readings[0]), float(instants[0])
    (0.0, -0.37)
    """
    readings = np.arange(round(length * clock.rate) + 1) / clock.rate
    return readings, (readings - clock.offset) / (1.0 + 1e-6 * clock.drift)


def trigger(time: FloatArray, period: float, width: float) -> FloatArray:
    """Trigger that every logger records: raised-cosine pulses of height one, the first at 10 s."""
    phase = (time - FIRST_PULSE + 0.5 * period) % period - 0.5 * period
    return np.where(np.abs(phase) < 0.5 * width, 0.5 + 0.5 * np.cos(2 * np.pi * phase / width), 0.0)


def slap_pulses(
    time: FloatArray, immersed: npt.NDArray[np.bool_], slap: SlapSettings, rng: np.random.Generator
) -> FloatArray:
    """Decaying pulses (N) at each immersion and emergence of a line, at uniform instants.

    `immersed` says when the line's middle is under water.
    """
    out = np.zeros(time.size)
    step = time[1] - time[0]
    for start in (np.flatnonzero(immersed[1:] != immersed[:-1]) + 1).tolist():
        height = rng.exponential(slap.mean) * rng.choice([-1.0, 1.0])
        frequency, decay = rng.uniform(*slap.frequency), rng.uniform(*slap.decay)
        stop = min(time.size, start + int(8 * decay / step) + 1)
        since = step * np.arange(stop - start)
        out[start:stop] += height * np.exp(-since / decay) * np.sin(2 * np.pi * frequency * since)
    return out


def _dropouts(
    values: FloatArray, rate: float, share: float, rng: np.random.Generator
) -> FloatArray:
    """Replace bursts of 20–200 ms by NaN, on average for `share` of the time."""
    if share <= 0:
        return values
    out = values.copy()
    bursts = rng.poisson(share * values.size / rate / 0.11)
    for start in np.sort(rng.integers(0, values.size, bursts)):
        out[start : start + max(1, round(rng.uniform(0.02, 0.2) * rate))] = np.nan
    return out


def _probes(
    played: Played, time: FloatArray, rate: float, rng: np.random.Generator
) -> dict[str, Column]:
    instruments = played.settings.instruments
    at: dict[float, FloatArray] = {}
    columns = {}
    for name, probe in instruments.probes.items():
        if probe.position not in at:
            at[probe.position] = played.elevation(probe.position, time)
            if instruments.second_order:
                at[probe.position] = at[probe.position] + played.crest(probe.position, time)
        values = at[probe.position] + probe.noise * rng.standard_normal(time.size)
        values = _dropouts(values, rate, probe.dropouts, rng)
        columns[name] = Column("mm", 1e3 * values, 2)
    return columns


def _mru(played: Played, time: FloatArray, _: float, rng: np.random.Generator) -> dict[str, Column]:
    noise = played.settings.instruments
    q, v, a = played.states(time)
    zero = np.zeros(time.size)

    def column(unit: str, true: FloatArray, sigma: float, decimals: int) -> Column:
        factor = np.rad2deg(1.0) if unit.startswith("deg") else 1.0
        noisy = true + sigma * rng.standard_normal(time.size)
        return Column(unit, factor * noisy, decimals)

    sigma_a, sigma_r, sigma_t = noise.acceleration_noise, noise.rate_noise, noise.angle_noise
    return {
        "acceleration_x": column("m/s^2", a[0], sigma_a, 4),
        "acceleration_y": column("m/s^2", zero, sigma_a, 4),
        "acceleration_z": column("m/s^2", a[1], sigma_a, 4),
        "rate_x": column("deg/s", zero, sigma_r, 4),
        "rate_y": column("deg/s", v[2], sigma_r, 4),
        "rate_z": column("deg/s", zero, sigma_r, 4),
        "heave": column("m", q[1], noise.heave_noise, 5),
        "roll": column("deg", zero, sigma_t, 4),
        "pitch": column("deg", q[2], sigma_t, 4),
        "yaw": column("deg", zero, sigma_t, 4),
    }


def _immersed(played: Played, time: FloatArray, line: int) -> npt.NDArray[np.bool_]:
    """Whether the middle of a line is under water."""
    settings = played.settings.moorings[played.rig.line_names[line]]
    q, _, _ = played.states(time)
    eye_x = q[0] + settings.eye[0] + played.settings.vessel.position
    eye_z = q[1] - settings.eye[0] * q[2] + settings.eye[1]
    middle_x, middle_z = 0.5 * (eye_x + settings.pole[0]), 0.5 * (eye_z + settings.pole[1])
    under: npt.NDArray[np.bool_] = played.elevation(middle_x, time) > middle_z
    return under


def _loads(
    played: Played, time: FloatArray, _: float, rng: np.random.Generator
) -> dict[str, Column]:
    instruments = played.settings.instruments
    true = played.loads(time)
    # Whether a line is wet changes slowly: every tenth sample finds the crossings.
    coarse = time[::10]
    columns = {}
    for line, name in enumerate(played.rig.line_names):
        values = true[line] + instruments.load_noise * rng.standard_normal(time.size)
        slap = instruments.slap.get(name)
        if slap is not None:
            wet = np.repeat(_immersed(played, coarse, line), 10)[: time.size]
            values = values + slap_pulses(time, wet, slap, rng)
        columns[f"mooring_{name}"] = Column("N", values, 4)
    return columns


def _video(
    played: Played, time: FloatArray, _: float, rng: np.random.Generator
) -> dict[str, Column]:
    surge = played.states(time)[0][0]
    noisy = surge + played.settings.instruments.surge_noise * rng.standard_normal(time.size)
    return {"surge": Column("m", noisy, 5)}


_MAKERS: dict[Logger, Callable[..., dict[str, Column]]] = {
    "wave_probes": _probes,
    "mru": _mru,
    "loads": _loads,
    "video": _video,
}
"""What each logger records of a run at instants, from a run, instants, rate and generator."""


def _pulse(
    settings: InstrumentPlan, name: str, time: FloatArray, rng: np.random.Generator
) -> dict[str, Column]:
    pulse = trigger(time, settings.trigger_period, settings.trigger_width)
    noise = rng.standard_normal(time.size)
    if name == "video":
        return {"lamp": Column("-", pulse + LAMP_NOISE * noise, 4)}
    return {"trigger": Column("V", TRIGGER_VOLTS * pulse + TRIGGER_NOISE * noise, 4)}


def record_run(played: Played, rng: np.random.Generator) -> list[Record]:
    """Record a run with all instruments, each in its own clock and with its own noise."""
    settings = played.settings.instruments
    records = []
    for (name, make), child in zip(_MAKERS.items(), rng.spawn(len(_MAKERS)), strict=True):
        clock = settings.clocks[name]
        readings, instants = clock_instants(clock, played.length)
        columns = _pulse(settings, name, instants, child) | make(
            played, instants, clock.rate, child
        )
        records.append(Record(name, readings, columns))
    return records


def record_together(played: Played, rate: float, rng: np.random.Generator) -> Record:
    """Record a run with all instruments on one logger of the given rate (Hz)."""
    time, _ = clock_instants(ClockSettings(rate=rate), played.length)
    columns: dict[str, Column] = {}
    for make, child in zip(_MAKERS.values(), rng.spawn(len(_MAKERS)), strict=True):
        columns |= make(played, time, rate, child)
    return Record("all", time, columns)
