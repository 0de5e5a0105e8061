from math import tau

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose
from said import request_error

from seakeep.tank.seas import (
    BLOCK,
    Sea,
    irregular_sea,
    jonswap,
    pierson_moskowitz,
    regular_sea,
    sea_of_run,
    spectral_density,
)
from seakeep.tank.settings import RunPlan, SpectrumSettings
from seakeep.waves import wavenumber


def rng():
    return np.random.default_rng(3)


def test_height_and_peak_of_the_spectra():
    f = np.geomspace(0.02, 40, 40001)
    for density in (pierson_moskowitz(f, 0.15, 2.12), jonswap(f, 0.15, 2.12)):
        assert_allclose(4 * np.sqrt(np.trapezoid(density, f)), 0.15, rtol=1e-3)
        assert_allclose(1 / f[np.argmax(density)], 2.12, rtol=1e-3)
    assert_allclose(jonswap(f, 0.15, 2.12, 1.0), pierson_moskowitz(f, 0.15, 2.12), rtol=1e-3)


@pytest.mark.oracle
def test_spectra_are_those_of_wavespectra():
    frequency = pytest.importorskip("wavespectra.construct.frequency")
    f = np.linspace(0.2, 2.0, 181)
    theirs = np.asarray(frequency.pierson_moskowitz(f, hs=0.15, fp=1 / 2.12))
    steeper = np.asarray(frequency.jonswap(f, fp=1 / 2.12, gamma=3.3, hs=0.15))
    for spectrum, known in ((pierson_moskowitz, theirs), (jonswap, steeper)):
        ours = spectrum(f, 0.15, 2.12)
        # The outside package integrates its shape over these frequencies to set its height.
        assert_near(known / known.max(), ours / ours.max(), 1e-3)


def test_components_hold_the_energy_of_the_band():
    spectrum = SpectrumSettings(height=0.15, peak_period=2.12, spacing="equal")
    sea = irregular_sea(spectrum, 3.6, rng())
    f = np.linspace(0.28, 1.13, 20001)
    variance = np.trapezoid(pierson_moskowitz(f, 0.15, 2.12), f)
    # √(2EΔf); the paper's √(4πEΔf) would give 0.37 m instead of 0.147 m.
    assert_allclose(0.5 * np.sum(sea.amplitude**2), variance, rtol=5e-3)
    assert sea.omega.size == 100
    assert sea.omega[[0, -1]] / tau == pytest.approx([0.28, 1.13])


def test_jitter_keeps_each_component_in_its_bin():
    spectrum = SpectrumSettings(height=0.15, peak_period=2.12, components=40)
    f = irregular_sea(spectrum, 3.6, rng()).omega / tau
    assert np.array_equal(np.floor((f - 0.28) / (0.85 / 40)), np.arange(40))


def test_a_table_is_a_spectrum_as_well():
    table = SpectrumSettings(
        kind="table", frequencies=(0.3, 0.5, 0.9), densities=(0.0, 2e-3, 0.0), band=(0.3, 0.9)
    )
    assert spectral_density(table, [0.2, 0.4, 0.5, 1.0]) == pytest.approx([0, 1e-3, 2e-3, 0])
    sea = irregular_sea(table, 3.6, rng())
    assert_allclose(0.5 * np.sum(sea.amplitude**2), 0.5 * 0.6 * 2e-3, rtol=0.02)


def test_fixed_places_are_evaluated_in_blocks_to_the_same_value():
    sea = irregular_sea(SpectrumSettings(height=0.15, peak_period=2.12), 3.6, rng())
    t = -1.2 + np.arange(3 * BLOCK + 7) / 500.0
    parts = np.concatenate([sea.elevation(-3.67, part) for part in np.array_split(t, 8)])
    assert_near(sea.elevation(-3.67, t), parts, 1e-13)


def test_a_moving_place_sees_the_doppler_shift():
    omega = 4.0
    k = float(wavenumber(omega, 3.6))
    sea = Sea(np.array([omega]), np.array([0.1]), np.array([0.3]), np.array([k]))
    t = np.linspace(0, 20, 400)
    assert_near(sea.elevation(0.5 * t, t), 0.1 * np.cos((0.5 * k - omega) * t + 0.3), 1e-13)


def test_unsteadiness_spreads_the_heights():
    spreads = []
    for unsteadiness in (0.03, 0.05):
        sea = regular_sea(2.8, 0.1, unsteadiness, 3.6, rng())
        envelope = np.abs(sea.analytic(0.0, np.arange(0, 3000, 0.5)))
        spreads.append(envelope.std() / envelope.mean())
    # Two sidebands of a part ε each: the envelope's deviation is ε.
    assert_allclose(spreads, [0.03, 0.05], rtol=0.05)


@pytest.mark.parametrize(
    ("message", "run"),
    {
        r"runs\.odd asks for waves of 1\.77 Hz; .*0\.1–1\.4": {"wavelength": 0.5, "height": 0.05},
        r"runs\.odd asks for waves 0\.6 m high; .* 0\.45 m": {"wavelength": 2.0, "height": 0.6},
        r"asks for waves of 0\.05–1 Hz; the wave maker covers": {
            "spectrum": {"height": 0.1, "peak_period": 2.0, "band": (0.05, 1.0)}
        },
    }.items(),
)
def test_waves_beyond_the_wave_maker_are_refused(settings, run, message):
    with request_error(message):
        sea_of_run("odd", RunPlan.model_validate(run), settings.facility, rng())
