from dataclasses import replace
from math import tau

import numpy as np
import pytest
from altered import altered
from near import assert_near
from numpy.testing import assert_allclose
from said import request_error
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline

from seakeep.tank.dynamics import (
    DivergenceError,
    _drift_terms,
    assemble_rig,
    drift_coefficient,
    drift_envelopes,
    linear_response,
    mean_drift,
    sea_losses,
    simulate,
    tensions,
)
from seakeep.tank.hydrodynamics import excitation_at, far_field_at
from seakeep.tank.seas import Sea, regular_sea
from seakeep.tank.settings import DriftSettings
from seakeep.waves import wavelength_to_frequency, wavenumber

pytest.importorskip("numba")


def wave(length, height):
    return regular_sea(length, height, 0.0, 3.6, np.random.default_rng(0))


def small_sea(omega, amplitude=1e-5):
    omega = np.asarray(omega)
    phase = np.linspace(0.0, 5.0, omega.size)
    return Sea(omega, np.full(omega.size, amplitude), phase, wavenumber(omega, 3.6))


def harmonics(motion, sea, begin):
    """Complex amplitude of each degree of freedom at each frequency, by least squares."""
    kept = motion.time >= begin
    t = motion.time[kept]
    columns = [np.ones_like(t)]
    for omega, phase in zip(sea.omega, sea.phase, strict=True):
        columns += [np.cos(omega * t - phase), np.sin(omega * t - phase)]
    fit, *_ = np.linalg.lstsq(np.column_stack(columns), motion.position[:, kept].T, rcond=None)
    return (fit[1::2] + 1j * fit[2::2]) / sea.amplitude[:, None]


def test_response_in_time_is_that_in_frequency(linear_rig):
    ratios = np.array([1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0])
    sea = small_sea(wavelength_to_frequency(1.4 * ratios, 3.6))
    # Surge swings on its moorings with a decay time of 70 s: the ramp hardly excites it.
    found = harmonics(simulate(linear_rig, sea, 500.0), sea, 350.0)
    stiffness, damping = linear_rig.mooring_stiffness, linear_rig.linear_damping
    damping = damping.copy()
    damping[0, 0] += linear_rig.lines[:, 6].sum()
    hydro, w = linear_rig.hydro, sea.omega[:, None, None]
    added, radiated = (  # of the file, not of the kernel that the loop runs
        CubicSpline(hydro.omega, 0.5 * (m + m.swapaxes(1, 2)))(sea.omega)
        for m in (hydro.added_mass, hydro.damping)
    )
    dynamic = -(w**2) * (hydro.mass + added) - 1j * w * (radiated + damping)
    force = excitation_at(hydro, sea.omega)[..., None]
    expected = np.linalg.solve(dynamic + hydro.stiffness + stiffness, force)[..., 0]
    # The bound; it grants 4 % to heave at λ/L 1.5, where opposite forces of buoyancy and
    # pool all but cancel.
    assert_near(np.abs(found / expected)[:, :3], 1.0, 0.01)
    # With their phases: surge swings on its moorings for minutes.
    assert np.all(np.abs(found / expected - 1.0)[:, :3].max(axis=0) < [0.013, 0.007, 0.007])
    # The coefficients of the kernel, which ends after some time, are the file's to 1.5 %.
    assert_near(linear_response(linear_rig, sea.omega, damping) / expected, 1.0, 0.02)


@pytest.mark.parametrize("dof", range(4))
def test_energy_goes_into_radiated_waves_alone(ideal_rig, dof):
    start = np.zeros((2, 5))
    start[0, dof] = 0.05
    motion, rig = simulate(ideal_rig, small_sea([]), 60.0, start), ideal_rig
    power = np.sum(motion.memory * motion.velocity, axis=0)
    work = cumulative_simpson(power, dx=rig.step, initial=0.0)
    energy = 0.5 * sum(
        np.einsum("it,ij,jt->t", each, matrix, each)
        for each, matrix in (
            (motion.velocity, rig.inertia),
            (motion.position, rig.hydro.stiffness + rig.mooring_stiffness),
        )
    )
    # Second-order error of the memory's quadrature: (6.3 rad/s × 0.01 s)² / 12 = 3e-4 a radian.
    assert_near(energy + work, energy[0], 2e-3 * energy[0])
    # A passive kernel takes energy out, whatever the motion was so far, to a millionth of a joule.
    assert work.min() > -1e-6
    assert work[-1] > 0


def viscous_power(rig, motion, late):
    """Mean power that all viscous losses take in the time domain, W."""
    v = motion.velocity[:, late]
    relative = v[3] - (v[1] - rig.pool[0] * v[2])
    drag = np.sum(v**2 * (rig.linear + rig.quadratic * np.abs(v).T).T, axis=0)
    return np.mean(drag + relative**2 * (rig.pool[2] + rig.pool[1] * np.abs(relative)))


@pytest.mark.parametrize(("length", "height"), [(2.1, 0.105), (2.8, 0.107), (4.2, 0.116)])
def test_drift_is_what_energy_and_momentum_allow(rig, length, height):
    """The losses of the simulated vessel and the waves that go out account for the drift force."""
    sea = wave(length, height)
    motion = simulate(rig, sea, 240.0)
    late = motion.time > motion.time[-1] - 20 * tau / sea.omega[0]
    absorbed = viscous_power(rig, motion, late) / sea.amplitude[0] ** 2
    both = np.append(1.0, linear_response(rig, sea.omega, sea_losses(rig, sea))[0])
    out, along = np.real(np.conj(both) @ far_field_at(rig.hydro, sea.omega)[0] @ both)
    allowed = sea.wavenumber[0] / sea.omega[0] * (absorbed + out - along)
    # The linearised losses are those of a sinusoid, and the taut stern line is not always there.
    assert_allclose(drift_coefficient(rig, sea)[0][0], allowed, rtol=0.03)


def slow_force(signs, envelopes, sea, time):
    at_vessel = np.exp(1j * (sea.phase[:, None] - np.outer(sea.omega, time)))
    return signs @ np.abs(envelopes @ at_vessel) ** 2


def test_full_transfer_function_of_two_waves(rig):
    """Against the pairs of components, written out."""
    rig = replace(rig, drift=DriftSettings(law="qtf"))
    sea = small_sea([3.0, 3.9], 0.02)
    both, force = _drift_terms(rig, sea.omega, sea_losses(rig, sea))
    time = np.linspace(0.0, 30.0, 200)
    z = sea.amplitude * np.exp(1j * (sea.phase - np.outer(time, sea.omega)))
    pairs = 0.5 * (both.conj() @ force.T + force.conj() @ both.T)
    expected = np.einsum("tm,mn,tn->t", z.conj(), pairs, z).real
    assert_near(slow_force(*drift_envelopes(rig, sea), sea, time), expected, 1e-5 * expected.max())


@pytest.mark.parametrize("law", ["newman", "qtf"])
def test_played_drift_is_that_of_its_law(linear_rig, law):
    """Two weak waves beat; the vessel swings as their force drives it on its lines."""
    damped = linear_rig.linear * [20.0, 1, 1, 1, 1]  # the start dies out in 4 s
    rig = replace(linear_rig, drift=DriftSettings(law=law, damping=False), linear=damped)
    sea = small_sea([4.0, 4.0 + tau / 20.0], 0.01)
    motion = simulate(rig, sea, 120.0)
    late = (motion.time > 80.0) & (motion.time < 120.0)  # two beats
    force = slow_force(*drift_envelopes(rig, sea), sea, motion.time[late])
    found = motion.slow_surge[late] * rig.mooring_stiffness[0, 0]
    beat = tau / 20.0
    inertia = rig.hydro.mass[0, 0] + rig.hydro.added_mass[0, 0, 0]
    swing = rig.mooring_stiffness[0, 0] - beat**2 * inertia - 1j * beat * damped[0]
    wanted = force.std() * rig.mooring_stiffness[0, 0] / np.abs(swing)
    # The lines' own damping is 0.7 % of the vessel's here; the added mass is that at 0.3 rad/s.
    assert_allclose(found.mean(), force.mean(), rtol=0.02)
    assert_allclose(found.std(), wanted, rtol=0.02)


def test_radiated_waves_carry_the_power_of_the_damping(hydro):
    radiated = 0.5 * hydro.omega[:, None] ** 2 * np.diagonal(hydro.damping, axis1=1, axis2=2)
    far = np.diagonal(hydro.far_field[:, 0], axis1=1, axis2=2)[:, 1:].real
    band = (hydro.omega > 2.0) & (hydro.omega < 7.5)
    # Pressure at the hull against Kochin's function: the panels leave one to three percent.
    assert_allclose(far[band][:, :4], radiated[band][:, :4], rtol=0.03)


def test_drift_of_short_waves_is_that_of_a_wall(rig):
    wall = 0.5 * 1000 * 9.81 * 0.86
    # A superellipse reflects nearly all, most of it back.
    assert 0.6 * wall < drift_coefficient(rig, small_sea([12.0], 0.01))[0][0] < wall


def test_runs_start_anywhere_on_the_time_axis(linear_rig):
    sea = small_sea([3.0])
    early, late = simulate(linear_rig, sea, 300.0, begin=-3.0), simulate(linear_rig, sea, 303.0)
    # Same phases at the same time; only the ramps differ, and have died out but in slow surge.
    fast = [m.position[1, np.searchsorted(m.time, 250.0 - 1e-9)] for m in (early, late)]
    assert_allclose(fast[0], fast[1], rtol=1e-3)


def test_divergence_names_time_and_degree_of_freedom(rig):
    sea = wave(2.1, 40.0)
    with pytest.raises(
        DivergenceError,
        match=r"diverged at t = \d+\.\d\d s in (surge|heave|pitch|piston|slosh), which passed .*"
        r"Lower the waves",
    ):
        simulate(rig, sea, 60.0)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [("water_depth", 2.0, r"water_depth is 2 and the .* made for 3\.6\. Set"),
     ("density", 1025.0, r"density is 1025 .* made for 1000\.")],
)  # fmt: skip
def test_depth_and_density_must_be_those_of_the_file(settings, hydro, key, value, words):
    facility = altered(settings.facility, **{key: value})
    with request_error(words):
        assemble_rig(altered(settings, facility=facility), hydro)


def test_other_vessels_need_no_code(settings, hydro):
    """A hull without a pool (three degrees of freedom) and with one line runs as well."""
    part = slice(0, 3)
    square = {
        name: getattr(hydro, name)[..., part, part]
        for name in ("added_mass", "damping", "mass", "stiffness")
    }
    plain = replace(
        hydro,
        names=hydro.names[part],
        excitation=hydro.excitation[:, part],
        far_field=hydro.far_field[:, :, :4, :4],
        **square,
    )
    lines = {"single": altered(settings.moorings["bow"], pretension=0.0)}
    rig = assemble_rig(altered(settings, moorings=lines), plain)
    motion = simulate(rig, wave(2.8, 0.1), 30.0)
    assert len(motion.position) == 3
    assert tensions(rig, motion.position, motion.velocity).shape == (1, motion.time.size)
    assert 0.01 < motion.position[1].std() < 0.1


def test_wave_drift_damping_is_aranhas(rig):
    """The force at a slow drift U is D(ω − ω²U/g)(1 − 4ωU/g), by which the frequency is met."""
    sea = small_sea(np.array([3.0, 4.0, 5.0]), 0.01)
    losses, w, drift = sea_losses(rig, sea), sea.omega, 1e-3
    force, damping = drift_coefficient(rig, sea)
    met = [
        mean_drift(rig, w - sign * w**2 * drift / 9.80665, losses)
        * (1 - sign * 4 * w * drift / 9.80665)
        for sign in (1, -1)
    ]
    # Differences of a curve whose slope changes within a few tenths of rad/s.
    assert_allclose(damping, (met[1] - met[0]) / (2 * drift), rtol=0.05)
    assert_allclose(force, mean_drift(rig, w, losses), rtol=1e-12)
