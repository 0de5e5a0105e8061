"""Checks of a model against the virtual tank, whose response and damping are known."""

import numpy as np
import pytest
import xarray as xr

from seakeep import HankelDMDc, check
from seakeep.tank.dynamics import linear_response, simulate
from seakeep.tank.seas import Sea
from seakeep.waves import wavenumber

pytest.importorskip("numba", reason="needs the extra tank")

DT, DEPTH = 0.2, 3.6


def run_of(motion, sea, noise, **attrs):
    """Motions and the wave at the centre of gravity, with noise in parts of their SD."""
    every = round(DT / (motion.time[1] - motion.time[0]))
    time = motion.time[::every]
    channels = {"eta": sea.elevation(0.0, time)}
    motions = motion.position[:3, ::every]
    channels |= dict(zip(("surge", "heave", "pitch"), motions, strict=True))
    rng = np.random.default_rng(4)
    for name, values in channels.items():
        noisy = values + noise * values.std() * rng.standard_normal(values.size)
        channels[name] = ("time", noisy, {"units": "rad" if name == "pitch" else "m"})
    return xr.Dataset(channels, coords={"time": time}, attrs={"encounter_period": 1.6, **attrs})


def exact(rig, frequency):
    """Response of heave and pitch per metre of wave, by e^{+iωt}."""
    return np.conj(linear_response(rig, 2 * np.pi * np.asarray(frequency)))[:, 1:3]


def test_the_response_is_that_of_the_tank(linear_rig):
    rng = np.random.default_rng(3)
    omega = np.linspace(2.2, 6.2, 160) + rng.uniform(0, 0.025, 160)
    phase = rng.uniform(0, 2 * np.pi, 160)
    sea = Sea(omega, np.full(160, 1e-3), phase, wavenumber(omega, DEPTH))
    motion = simulate(linear_rig, sea, 660.0)
    run = run_of(motion, sea, 0.01, waves="irregular").sel(time=slice(60, None))  # past the ramp
    spec = HankelDMDc(16, 48, 1e-5, ridge_scale="per_snapshot", delay_rows="exact")
    model = spec.fit(run, ["heave", "pitch"], ["eta"])

    found = check.response(model, np.linspace(0.4, 0.9, 26)).sel(input="eta")
    ours = (found.amplitude * np.exp(1j * np.radians(found.phase))).T
    truth = exact(linear_rig, found.frequency)
    # Noise of 1 % in wave and motions, at amplitudes down to a third of the highest.
    assert np.abs(ours.values - truth).max() < 0.03 * np.abs(truth).max()

    measured = check.measured_response(model, {"run": run})
    inside = (measured.frequency > 0.4) & (measured.frequency < 0.85)  # whole segments of sea
    measured = measured.isel(point=np.flatnonzero(inside))
    truth = np.abs(exact(linear_rig, measured.frequency))
    error = np.abs(measured.amplitude.values - truth)
    assert np.mean(error < measured.amplitude_uncertainty.values) > 0.9
    assert measured.amplitude_uncertainty.values.max() < 0.05 * truth.max()


def test_decay_has_the_damping_of_the_tank(linear_rig, calm):
    start = np.zeros((2, 5))
    start[0, 0] = 0.05
    run = run_of(simulate(linear_rig, calm, 150.0, start), calm, 0.001, waves="still")
    hydro = linear_rig.hydro
    damping = linear_rig.linear_damping + hydro.damping[0]
    damping[0, 0] += linear_rig.lines[:, 6].sum()
    inertia = np.linalg.inv(hydro.mass + hydro.added_mass[0])
    stiffness = hydro.stiffness + linear_rig.mooring_stiffness
    none, one = np.zeros((5, 5)), np.eye(5)
    system = np.block([[none, one], [-inertia @ stiffness, -inertia @ damping]])
    surge = min(np.linalg.eigvals(system), key=lambda each: abs(abs(each) - 0.21))
    period, ratio = 2 * np.pi / abs(surge.imag), -surge.real / abs(surge)

    spec = HankelDMDc(40, 0, 1e-4, ridge_scale="per_snapshot", delay_rows="exact")
    model = spec.fit(run, ["surge"], [])
    # The radiation at 0.3 rad/s stands for that at 0.21; ranges carry noise of 1e-3.
    for found in (check.measured_decay(model, {"still": run}), check.decay(model)):
        assert float(found.period[0]) == pytest.approx(period, rel=0.005)
        assert float(found.damping_ratio[0]) == pytest.approx(ratio, rel=0.01)
