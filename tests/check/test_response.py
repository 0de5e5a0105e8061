"""Response of a model and of a measurement: exact where the law is known, sure where it is not."""

from dataclasses import replace
from math import tau

import numpy as np
import pytest
from drifting import DEPTH, DT, FOLLOWED, INPUTS, POSITIONS, SQUARES, STATES, drifting_run
from moored import moored_run
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose
from records import record, rms
from seas import Sea

from seakeep import HankelDMDc, Powers, check
from seakeep.check.parts import reference_probe
from seakeep.core.spectra import estimate, harmonic_fits
from seakeep.waves import wavenumber

FREQUENCIES = np.array([0.3, 0.5, 0.8])


def answer(frequency):
    """Heave per wave at the vessel: 0.8 of the wave 0.2 s before, 0.4 of that 0.5 s before."""
    turn = -1j * tau * np.asarray(frequency)
    return 0.8 * np.exp(0.2 * turn) + 0.4 * np.exp(0.5 * turn)


def phasors(found):
    return found.amplitude.values * np.exp(1j * np.radians(found.phase.values))


def vessel_run(frequencies, seed=0, samples=3000, noise=1e-5, surge=0.0, **attrs):
    """Waves past two probes, and a heave that answers them by :func:`answer` where it is."""
    rng, f = default_rng(seed), np.asarray(frequencies)
    waves = Sea(f, 0.02 * np.ones(f.size), rng.uniform(0, tau, f.size), DEPTH)
    time, of = DT * np.arange(samples), answer(f)
    answered = replace(waves, amplitude=0.02 * abs(of), phase=waves.phase + np.angle(of))
    attrs = {"water_depth": DEPTH, "encounter_period": 1.6, **attrs}
    heave = answered.at(time, POSITIONS["eta_cog"] + surge) + noise * rng.standard_normal(samples)
    run = record(DT, attrs, **{n: waves.at(time, x) for n, x in POSITIONS.items()}, heave=heave)
    for name, x in POSITIONS.items():
        run[name].attrs["x_position"] = x
    return run


@pytest.fixture(scope="module")
def sea():
    return vessel_run(default_rng(3).uniform(0.3, 0.9, 60), run="sea", waves="irregular")


@pytest.fixture(scope="module")
def model(sea):
    spec = HankelDMDc(0, 12, 1e-8, delay_rows="exact", ridge_scale="per_snapshot")
    return spec.fit(sea, ["heave"], ["eta_fwd", "eta_cog"])


@pytest.mark.parametrize("rows", ["exact", "ridge"])
def test_the_response_is_what_a_free_run_settles_to(rows):
    lead = HankelDMDc(2, 4, 0.1, delay_rows=rows, lead=3)
    model = lead.fit(moored_run(), ["surge", "heave"], ["eta"])
    turn = np.exp(1j * tau * 0.8 * DT * np.arange(-900, 900))[:, None]
    wave = 1e-3 * turn.real
    rest = np.tile(model.state_mean, (900, 1))
    forecast = model.forecast_arrays(rest, wave[:900], wave[900:], 800)
    found = check.response(model, [0.8]).isel(input=0, frequency=0)
    still = forecast[-200:] - (1e-3 * phasors(found) * turn[1500:1700]).real
    # The mean of the input was not zero, so the run settles to another level: a constant is left.
    assert_near(np.ptp(still, axis=0), [0, 0], 1e-9)


def test_a_passing_wave_adds_the_probes(sea, model):
    found = check.response(model, FREQUENCIES, {"sea": sea})
    assert list(found["input"].values) == ["eta_fwd", "eta_cog", "wave"]
    assert found.attrs["reference"] == "eta_cog"
    wave = found.sel(input="wave", state="heave")
    # Sensor noise of 1e-5 beside waves of 0.1 m, and the ridge.
    assert np.abs(phasors(wave) - answer(FREQUENCIES)).max() < 2e-3
    assert found.trained.sel(input="wave").values.tolist() == [True, True, True]
    assert not check.response(model, [2.5]).trained.any()


def test_points_of_irregular_waves_hold_the_truth_up_to_the_edges_of_the_spectrum(model):
    rng = default_rng(8)
    inside = []
    for seed in range(5):
        run = vessel_run(0.3 + 0.6 * rng.beta(2.0, 3.0, 300), seed, noise=0.01, waves="irregular")
        at = check.measured_response(model, {"run": run}).isel(state=0)
        error = np.abs(phasors(at) - answer(at.frequency.values))
        inside.append(error < at.amplitude_uncertainty.values)
    # Circles of 95 %; without what leakage adds they hold 79 %.
    assert 0.9 < np.mean(np.concatenate(inside)) < 0.99


def test_a_rate_of_an_elevation_is_no_reference(sea):
    rate = np.gradient(sea["eta_cog"].values, DT)
    given = sea.assign(eta_cog_rate=("time", rate, {"units": "m/s", "x_position": 1.0}))
    names = ["eta_fwd", "eta_cog", "eta_cog_rate"]
    model = HankelDMDc(4, 8, 1.0, delay_rows="exact").fit(given, ["heave"], names)
    assert model.inputs[reference_probe(model, {"sea": given})] == "eta_cog"


def test_measured_phases_count_from_the_waves_where_the_vessel_is():
    spec = HankelDMDc(2, 4, 0.1, alignment=FOLLOWED, delay_rows="exact")
    model = spec.fit(drifting_run(), STATES, INPUTS)
    away = 0.6  # m: half a wave of 3.2 m is 1.6
    drifted = vessel_run([0.7], samples=1200, surge=away, waves="regular", encounter_period=1.4)
    surge = away + 1e-4 * default_rng(0).standard_normal(1200)
    drifted["surge"] = "time", surge, {"units": "m"}
    runs = {"regular": drifted, "sea": drifting_run(1, 6000).assign_attrs(waves="irregular")}
    found = check.measured_response(model, runs).sel(state="heave")
    error = np.abs(phasors(found) - answer(found.frequency.values))
    regular = found.kind.values == "regular"
    assert error[regular] < 0.01
    # From the probe this drift of 0.6 m both ways, by up to 100°, leaves half of the answer.
    assert rms(error[~regular]) < 0.1


def test_a_model_that_follows_its_surge_answers_what_its_carriers_read(drifts, drift):
    observables = (SQUARES, Powers(tuple(INPUTS)))  # of small waves nothing
    spec = HankelDMDc(10, 40, 1e-3, delay_rows="exact", alignment=FOLLOWED, observables=observables)
    model = spec.fit(drifts, STATES, INPUTS)
    # Without look-ahead carriers read these waves wrongly by an eighth, a twelfth and a half.
    waves = np.array([0.3, 0.7, 0.85])
    found = check.response(model, waves, {"sea": drift}).sel(input="wave", state="heave")
    place, time = model.signature.input_map.follows.place.centre, DT * np.arange(-600, 1300)
    rest = np.tile(model.state_mean, (600, 1))
    for wave, expected in zip(waves, phasors(found), strict=True):
        k = float(wavenumber(tau * wave, DEPTH))
        eta = np.cos(tau * wave * time[:, None] - k * np.array([*POSITIONS.values()]))
        moved, still = (
            model.forecast_arrays(rest, each[:600], each[600:], 1200)[-200:, 1]
            for each in (1e-5 * eta, 0 * eta)
        )
        turn = tau * wave * time[1600:1800] - k * (POSITIONS["eta_cog"] + place)
        answered = (expected * np.exp(1j * turn)).real
        # Without waves the squares let surge rest some millimetres from its mean.
        assert_near((moved - still) / 1e-5, answered, 0.02)


def test_accuracy_of_the_instruments_widens_the_interval(model):
    exact = vessel_run([0.6317], 7, 1200, 1e-3, waves="regular")
    rough = exact.copy(deep=True)
    rough.eta_cog.attrs["accuracy"] = 1e-3  # of 0.02 m: 5 %
    found = [check.measured_response(model, {"run": run}) for run in (exact, rough)]
    assert_near(found[0].frequency, 0.6317, 1e-4)
    judged = check.validation(model, {"run": exact}, found[0])
    assert judged.within.all()
    assert (abs(found[0].amplitude - abs(answer(0.6317))) < judged.uncertainty).all()
    wide = float(found[1].amplitude_uncertainty[0, 0])
    # Two standard uncertainties of the ratio; the scatter over windows adds little.
    assert_allclose(wide, 1.96 * 0.05 * float(found[1].amplitude[0, 0]), rtol=0.03)
    assert wide > 5 * found[0].amplitude_uncertainty[0, 0]


def test_intervals_of_a_harmonic_fit_cover_as_they_say():
    rng = default_rng(5)
    time = DT * np.arange(900)
    wave = np.cos(tau * 0.5 * time)
    truth = 0.7 * np.exp(0.4j)
    clean = (truth * np.exp(1j * tau * 0.5 * time)).real
    many = clean[:, None] + 0.3 * rng.standard_normal((900, 500))
    harmonics, means = harmonic_fits(np.column_stack([wave, many]), DT, 0.5)
    found = estimate(harmonics[:, 1:] / harmonics[:, :1], np.zeros(500))
    inside = np.abs(np.abs(found.ratio) - 0.7) < found.amplitude
    turned = np.abs(np.angle(found.ratio / truth)) < found.phase
    # 500 repetitions know a coverage of 95 % to 1 % (one SD).
    assert 0.92 <= inside.mean() <= 0.98
    assert 0.92 <= turned.mean() <= 0.98
    offset = estimate(means[:, 1:].astype(complex), np.zeros(500))
    assert 0.92 <= np.mean(np.abs(offset.ratio.real) < offset.amplitude) <= 0.98


def test_type_a_uncertainty_is_that_of_the_mean_of_few_windows():
    found = estimate(np.array([1.0, 1.2, 1.1])[:, None].astype(complex), np.zeros(1))
    # Student's t of two degrees of freedom times 0.1/√3.
    assert_allclose(found.amplitude[0], 4.302653 * 0.1 / np.sqrt(3), rtol=1e-6)
