"""Averages of the states over doubling blocks of delays, beyond those that stand alone."""

import numpy as np
import pytest
import xarray as xr

from seakeep import BayesianHankelDMDc, HankelDMDc, RequestError, Uniform, load_model

DT = 0.1
WEIGHTS = np.array([0.9, -0.5, 0.0, 0.0, 0.0, *[0.3 / 4] * 4, *[-0.4 / 8] * 8])
"""Of x(k) … x(k − 16): two delays, and the means of delays 5 to 8 and 9 to 16."""
SPEC = HankelDMDc(4, 0, 0.0, standardize=False, delay_rows="exact", memory=16)


def remembering(seed: int, samples: int = 300) -> xr.Dataset:
    """A heave that remembers means of its past, driven by the wave of the instant."""
    rng = np.random.default_rng(seed)
    heave, eta = rng.standard_normal((2, samples))
    for k in range(16, samples - 1):
        heave[k + 1] = WEIGHTS @ heave[k - 16 : k + 1][::-1] + 0.7 * eta[k]
    return xr.Dataset(
        {"heave": ("time", heave, {"units": "m"}), "eta": ("time", eta, {"units": "m"})},
        coords={"time": DT * np.arange(samples)},
        attrs={"encounter_period": 0.4},
    )


@pytest.fixture(scope="module")
def model():
    return SPEC.fit([remembering(1), remembering(2)], ["heave"], ["eta"])


def test_a_sparse_memory_is_recovered_and_one_of_another_length_is_not(model):
    # Exact data: what is left is rounding times the condition number, below 1e3.
    np.testing.assert_allclose(model.A[0], WEIGHTS, rtol=0, atol=1e-10)
    np.testing.assert_allclose(model.B[0], [0.7], rtol=0, atol=1e-10)
    run = remembering(7)
    forecast = model.forecast(run, start=5.0, steps=200)
    np.testing.assert_allclose(forecast.heave, run.heave[51:251], rtol=0, atol=1e-9)
    cut = HankelDMDc(4, 0, 0.0, standardize=False, delay_rows="exact", memory=12)
    other = cut.fit(remembering(1), ["heave"], ["eta"])
    assert np.abs(other.A[0] - WEIGHTS[:13]).max() > 1e-3


def test_a_forecast_reads_the_memory_and_nothing_before_or_after_it(model):
    run, start, steps = remembering(7), 60, 80
    expected = model.forecast(run, start * DT, steps)
    assert model.history_samples == model.settings.needs(DT).history + 1 == 17
    poisoned = run.copy(deep=True)
    for name in ("heave", "eta"):
        poisoned[name].values[: start - 16] = np.nan
    poisoned["heave"].values[start + 1 :] = np.nan
    poisoned["eta"].values[start + steps :] = np.nan
    xr.testing.assert_identical(model.forecast(poisoned, start * DT, steps), expected)
    changed = run.copy(deep=True)
    changed["heave"].values[start - 16] += 1.0
    assert np.abs(model.forecast(changed, start * DT, steps).heave - expected.heave).max() > 1e-3


def test_training_reads_no_sample_of_a_gap_before_its_window():
    runs = [remembering(1), remembering(2)]
    whole = HankelDMDc(4, 0, 1e-3, delay_rows="exact", memory="4 T", window=200)
    expected = whole.fit(runs, ["heave"], ["eta"])
    assert expected.settings.memory == 16
    for run in runs:
        run["heave"].values[: 300 - 200 - 16] = np.nan
    found = whole.fit(runs, ["heave"], ["eta"])
    # Sums from another sample on.
    np.testing.assert_allclose(found.coefficients, expected.coefficients, rtol=0, atol=1e-12)
    runs[0]["heave"].values[300 - 200 - 16] = np.nan
    with pytest.raises(ValueError, match="heave"):
        whole.fit(runs, ["heave"], ["eta"])


def test_members_and_files_remember_too(model, tmp_path):
    again = load_model(model.save(tmp_path / "model.nc"))
    np.testing.assert_array_equal(again.A, model.A)
    runs = [remembering(1), remembering(2)]
    spec = BayesianHankelDMDc(
        Uniform("0.5 T", "2 T"), 1, Uniform(0.1, 1), n_members=3, delay_rows="exact", memory="4 T"
    )
    ensemble = spec.fit(runs, ["heave"], ["eta"])
    assert ensemble.history_samples == 17
    for number, s in enumerate(ensemble.draws.state_delays_samples.values.tolist()):
        draw = ensemble.members[number].settings
        assert (draw.state_delays, draw.memory) == (s, 16)
        single = HankelDMDc(s, 1, draw.ridge, delay_rows="exact", memory=16)
        expected = single.fit(runs, ["heave"], ["eta"]).coefficients
        np.testing.assert_allclose(ensemble.member(number).A[0], expected[0, :17], atol=1e-12)


@pytest.mark.parametrize("more", [{"delay_rows": "ridge"}, {"stable": True}])
def test_regressed_delay_rows_and_clipped_modes_have_no_memory(more):
    settings = {"delay_rows": "exact", "memory": "8 T", **more}
    with pytest.raises(RequestError, match="memory averages delayed states, which takes delay"):
        HankelDMDc(4, 4, 1.0, **settings)
