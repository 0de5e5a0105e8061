"""Single precision from the settings to the file: where it is used, kept and refused."""

import dataclasses

import numpy as np
import pytest
import xarray as xr

import seakeep
from seakeep.campaign import ModelSettings
from seakeep.errors import RequestError
from seakeep.study.specs import build_spec

DT = 0.05
CHANNELS = (["heave", "pitch"], ["eta_fwd"])
SPEC = seakeep.HankelDMDc(state_delays=4, input_delays=9, ridge=100.0, precision="single")


@pytest.fixture(scope="module")
def run():
    time = DT * np.arange(900)
    rng = np.random.default_rng(0)
    eta = np.sin(1.3 * time) + np.sin(2.1 * time + 1) + 0.1 * rng.normal(size=time.size)
    heave = np.convolve(eta, np.hanning(20) / 10)[: time.size] + 0.05 * rng.normal(size=time.size)
    pitch = np.gradient(heave) * 8 + 0.05 * rng.normal(size=time.size)
    series = {"heave": (heave, "m"), "pitch": (pitch, "rad"), "eta_fwd": (eta, "m")}
    return xr.Dataset(
        {name: ("time", values, {"units": units}) for name, (values, units) in series.items()},
        coords={"time": ("time", time, {"units": "s"})},
    )


def forecast(model, run):
    forecast = model.forecast(run, start=25.0, steps=300)
    return np.stack([forecast[name].values for name in CHANNELS[0]])


@pytest.mark.parametrize("delay_rows", ["ridge", "exact"])
def test_a_single_model_is_kept_as_it_is_and_near_the_double_one(run, delay_rows, tmp_path):
    spec = dataclasses.replace(SPEC, delay_rows=delay_rows)
    model = spec.fit(run, *CHANNELS, stop=25.0)
    double = dataclasses.replace(spec, precision="double").fit(run, *CHANNELS, stop=25.0)
    assert model.coefficients.dtype == np.float32
    # What is shown and exported is of the ordinary type.
    assert model.A.dtype == model.B.dtype == np.float64
    spread = model.state_std[:, None]
    error = np.abs((forecast(model, run) - forecast(double, run)) / spread).max()
    assert 0 < error < 1e-4  # what the package states
    loaded = seakeep.load_model(model.save(tmp_path / "rom.nc"))
    assert loaded.settings.precision == "single"
    assert loaded.coefficients.dtype == np.float32
    np.testing.assert_array_equal(forecast(loaded, run), forecast(model, run))
    kept = seakeep.load_model(double.save(tmp_path / "double.nc"))
    assert kept.settings.precision == "double"
    assert kept.coefficients.dtype == np.float64


def test_a_small_ridge_is_refused_when_the_model_is_fitted(run):
    with pytest.raises(RequestError, match=r"at least 100; received 50\. Use precision='double'"):
        dataclasses.replace(SPEC, ridge=50.0).fit(run, *CHANNELS)
    with pytest.raises(RequestError, match=r"precision must be 'double' or 'single'; received 'h"):
        dataclasses.replace(SPEC, precision="half")


def ensemble(ridge, **others):
    return seakeep.BayesianHankelDMDc(
        encounter_period=1.6,
        train_length=seakeep.Uniform(5, 10),
        state_delay=seakeep.Uniform(0.1, 0.3),
        input_delay=seakeep.Uniform(0.2, 0.5),
        ridge=ridge,
        n_members=4,
        precision="single",
        **others,
    )


def test_members_of_an_ensemble_are_single_and_survive_its_file(run, tmp_path):
    fitted = ensemble(seakeep.Uniform(100, 200)).fit(run, *CHANNELS, stop=25.0)
    assert fitted.member(0).coefficients.dtype == np.float32
    found = fitted.forecast(run, start=25.0, steps=100)
    for number in range(4):
        alone = fitted.member(number).forecast(run, start=25.0, steps=100)
        # One window either way: the same arithmetic.
        np.testing.assert_array_equal(found["heave"][number], alone["heave"])
    loaded = seakeep.load_model(fitted.save(tmp_path / "ens.nc"))
    xr.testing.assert_equal(loaded.forecast(run, start=25.0, steps=100), found)


def test_an_ensemble_with_a_small_ridge_among_its_draws_is_refused_at_once(run):
    with pytest.raises(RequestError, match=r"precision='single' needs an effective ridge"):
        ensemble(seakeep.Uniform(1, 200)).fit(run, *CHANNELS, stop=25.0)
    # 0.1 for each of at most 320 snapshot pairs; 1 for each of at least 160.
    with pytest.raises(RequestError, match=r"precision='single' needs an effective ridge"):
        ensemble(seakeep.Fixed(0.1), ridge_scale="per_snapshot").fit(run, *CHANNELS, stop=25.0)
    ensemble(seakeep.Fixed(1.0), ridge_scale="per_snapshot").fit(run, *CHANNELS, stop=25.0)


def test_a_campaign_file_may_ask_for_it():
    stated = {"states": ("heave",), "ridge": 100.0, "precision": "single"}
    one = ModelSettings(**stated, state_delays=3, input_delays=3)
    assert build_spec(one, 1.6, DT).precision == "single"
    many = ModelSettings(**stated, kind="bayesian_hankel_dmdc", preset="paper")
    assert build_spec(many, 1.6, DT).precision == "single"
