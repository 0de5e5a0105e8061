"""Instruments of the virtual tank: what each logger writes, in its own clock, with its noise.

A logger whose clock reads c(t) = offset + (1 + drift)·t at the reference time t samples at
uniform readings c. The 500 Hz logger of the wave probes is the reference.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
import xarray as xr
from numpy.random import Generator

from seakeep.arrays import BoolArray, FloatArray, Groups
from seakeep.signals.calculus import rising
from seakeep.tank.dynamics import Motion, Rig, tensions
from seakeep.tank.seas import Sea
from seakeep.tank.settings import ClockSettings, Logger, SlapSettings, TankSettings

Columns = dict[str, tuple[str, FloatArray]]
"""Unit and values of each column of a raw file."""

TRIGGER_VOLTS = 5.0
TRIGGER_NOISE = 0.01  # V
LAMP_NOISE = 0.02
FIRST_PULSE = 10.0  # s


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
        return rising((time - self.motion.time[0]) / self.rig.ramp)

    def elevation(self, place: float | FloatArray, time: FloatArray) -> FloatArray:
        """Linear elevation at a place in the tank (m from the wave maker), m."""
        x = place - self.settings.vessel.position
        return self.ramp(time) * self.sea.elevation(x, time)

    def crest(self, place: float, time: FloatArray) -> FloatArray:
        """Second-order part of the elevation at a fixed place, ½k(η² − η_H²), m."""
        analytic = self.sea.analytic(place - self.settings.vessel.position, time)
        squared = np.real(analytic**2) * self.ramp(time) ** 2
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
    return 1.0 - rising(np.abs(phase) / (0.5 * width))


def slap_pulses(
    time: FloatArray, immersed: BoolArray, slap: SlapSettings, rng: Generator
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


def _probes(played: Played, time: FloatArray, rate: float, rng: Generator) -> Columns:
    instruments = played.settings.instruments

    @functools.cache
    def wave(position: float) -> FloatArray:
        linear = played.elevation(position, time)
        return linear + played.crest(position, time) if instruments.second_order else linear

    columns = {}
    for name, probe in instruments.probes.items():
        values = wave(probe.position) + probe.noise * rng.standard_normal(time.size)
        # Bursts of 20–200 ms are lost; without any nothing is drawn.
        bursts = rng.poisson(probe.dropouts * time.size / rate / 0.11)
        for start in np.sort(rng.integers(0, time.size, bursts)):
            values[start : start + max(1, round(rng.uniform(0.02, 0.2) * rate))] = np.nan
        columns[name] = "mm", 1e3 * values
    return columns


def _mru(played: Played, time: FloatArray, _: float, rng: Generator) -> Columns:
    noise = played.settings.instruments
    q, v, a = played.states(time)
    zero = np.zeros(time.size)
    degree = np.rad2deg(1.0)
    true = [
        ("m/s^2", 1.0, noise.acceleration_noise,
         {"acceleration_x": a[0], "acceleration_y": zero, "acceleration_z": a[1]}),
        ("deg/s", degree, noise.rate_noise, {"rate_x": zero, "rate_y": v[2], "rate_z": zero}),
        ("m", 1.0, noise.heave_noise, {"heave": q[1]}),
        ("deg", degree, noise.angle_noise, {"roll": zero, "pitch": q[2], "yaw": zero}),
    ]  # fmt: skip
    return {
        name: (unit, factor * (values + sigma * rng.standard_normal(time.size)))
        for unit, factor, sigma, channels in true
        for name, values in channels.items()
    }


def _immersed(played: Played, time: FloatArray, line: str) -> BoolArray:
    """Whether the middle of a line is under water."""
    settings = played.settings.moorings[line]
    q, _, _ = played.states(time)
    eye_x = q[0] + settings.eye[0] + played.settings.vessel.position
    eye_z = q[1] - settings.eye[0] * q[2] + settings.eye[1]
    middle_x, middle_z = 0.5 * (eye_x + settings.pole[0]), 0.5 * (eye_z + settings.pole[1])
    return played.elevation(middle_x, time) > middle_z


def _loads(played: Played, time: FloatArray, _: float, rng: Generator) -> Columns:
    instruments = played.settings.instruments
    # Whether a line is wet changes slowly: every tenth sample finds the crossings.
    coarse = time[::10]
    columns = {}
    for name, true in zip(played.settings.moorings, played.loads(time), strict=True):
        values = true + instruments.load_noise * rng.standard_normal(time.size)
        if slap := instruments.slap.get(name):
            wet = np.repeat(_immersed(played, coarse, name), 10)[: time.size]
            values = values + slap_pulses(time, wet, slap, rng)
        columns[f"mooring_{name}"] = "N", values
    return columns


def _video(played: Played, time: FloatArray, _: float, rng: Generator) -> Columns:
    noise = played.settings.instruments.surge_noise * rng.standard_normal(time.size)
    return {"surge": ("m", played.states(time)[0][0] + noise)}


LOGGERS: dict[Logger, Callable[..., Columns]] = {
    "wave_probes": _probes,
    "mru": _mru,
    "loads": _loads,
    "video": _video,
}
"""What each logger records of a run at instants, from a run, instants, rate and generator."""


def record_run(played: Played, rng: Generator, single_rate: float | None = None) -> Groups:
    """Record a run with all instruments, each with its own noise.

    Parameters
    ----------
    played : Played
        The run.
    rng : Generator
        Source of the noise.
    single_rate : float, optional
        Rate (Hz) of one logger ``"all"`` for all instruments, on the reference clock and without
        trigger. By default each logger has its own rate and clock, and records the trigger.

    Returns
    -------
    dict of str to Dataset
        Logger → its columns, with units, over the readings of its clock (s).
    """
    instruments = played.settings.instruments
    records: Groups = {}
    for (name, make), child in zip(LOGGERS.items(), rng.spawn(len(LOGGERS)), strict=True):
        clock = ClockSettings(rate=single_rate) if single_rate else instruments.clocks[name]
        readings, instants = clock_instants(clock, played.length)
        columns: Columns = {}
        if not single_rate:
            pulse = trigger(instants, instruments.trigger_period, instruments.trigger_width)
            noise = child.standard_normal(instants.size)
            if name == "video":
                columns["lamp"] = "-", pulse + LAMP_NOISE * noise
            else:
                columns["trigger"] = "V", TRIGGER_VOLTS * pulse + TRIGGER_NOISE * noise
        columns |= make(played, instants, clock.rate, child)
        records[name] = xr.Dataset(
            {key: ("time", values, {"units": unit}) for key, (unit, values) in columns.items()},
            {"time": ("time", readings, {"units": "s"})},
        )
    return {"all": xr.merge(records.values())} if single_rate else records
