"""Modes of a known oscillator, the warning of an unstable model, and how its forecast ends."""

from dataclasses import replace

import numpy as np
import pytest
from ensembles import few
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from oscillators import OF_ARX, Oscillator, arx_run, growing_model
from said import warned

from seakeep import HankelDMDc, load_model

GROWING = arx_run(0, [1.2], [1.0], 60, 1.0)
"""A heave that grows by a fifth a step."""


def test_modes_are_natural_frequency_and_damping_of_the_oscillator():
    vessel = Oscillator()
    spec = HankelDMDc(1, 1, 0.0, standardize=False)
    identified = spec.fit(vessel.run(), states=["heave"], inputs=["eta_fwd"])
    mode, natural = identified.modes().isel(mode=0), vessel.frequency / (2 * np.pi)
    damped = natural * np.sqrt(1 - vessel.ratio**2)
    decay = 1 / (vessel.frequency * vessel.ratio)
    assert identified.modes().sizes["mode"] == 1
    expected = {
        "natural_frequency": natural,
        "damping_ratio": vessel.ratio,
        "frequency": damped,
        "period": 1 / damped,
        "decay_time": decay,
    }
    assert {key: float(mode[key]) for key in expected} == pytest.approx(expected, rel=1e-9)
    assert mode.natural_frequency.attrs["units"] == "Hz"


@pytest.mark.parametrize(("factor", "scale"), [(1.5, 1.0), (1e4, 1.0), (1e200, 1.0), (10.0, 1e8)])
def test_a_forecast_that_diverges_ends_in_nan_with_its_status(make_run, factor, scale):
    # The growth of the model is set by hand: what is tested is the end of the run, whatever the
    # speed it comes at and the unit it comes in. Warnings are errors in this suite.
    run = make_run(1060).map(lambda x: scale * x, keep_attrs=True)
    model = growing_model(run, factor)
    forecast = model.forecast(run, start=1.0)
    lost = np.isnan(forecast.heave.values)
    at = int(np.argmax(lost))
    assert lost.any()
    assert np.all(lost[at:])
    assert np.all(np.abs(forecast.heave[:at] - model.state_mean) <= 1e6 * model.state_std)
    assert forecast.attrs["status"] == f"diverged at t = {float(forecast.time[at]):g} s"
    # Seconds since 1970: the status still tells the sample.
    late = run.assign_coords(time=1.7e9 + run.time)
    told, expected = model.forecast(late, start=1.7e9 + 1.0).attrs, float(late.time[at + 21])
    assert told["diverged_at"] == expected
    instant = float(told["status"].removeprefix("diverged at t = ").removesuffix(" s"))
    assert instant == pytest.approx(expected, abs=1e-3, rel=0)


# ``stable`` clips what grows, says so, and leaves the rest.


@pytest.mark.parametrize(("stable", "radius"), [(True, 0.999), (0.97, 0.97)])
@pytest.mark.parametrize("rows", ["exact", "ridge"])
def test_the_growing_mode_alone_is_clipped_and_the_model_says_so(tmp_path, stable, radius, rows):
    spec = HankelDMDc(1, 1, 1.0, delay_rows=rows)
    unclipped = spec.fit(GROWING, *OF_ARX)
    with warned(r"is 1\.\d+: a free run grows by [12]\d % per step in .* or set stable = True\."):
        grows = unclipped.eigenvalues
    assert "UNSTABLE" in unclipped.summary()
    model = replace(spec, stable=stable).fit(GROWING, *OF_ARX)
    found = model.eigenvalues
    assert_allclose(model.spectral_radius, radius, rtol=1e-9)
    assert_near(found[1:], grows[1:], 1e-9)
    assert_allclose(model.training.clipped, [abs(grows[0])], rtol=1e-9)
    told = f"1 eigenvalue clipped to {radius:g}; the largest was {abs(grows[0]):.6f}"
    assert told in model.summary()
    assert load_model(model.save(tmp_path / "m.nc")).training.clipped == model.training.clipped


def test_a_stable_model_is_the_same_to_the_last_bit(run, channels):
    plain = HankelDMDc(2, 4, 100.0).fit(run, **channels)
    clipped = HankelDMDc(2, 4, 100.0, stable=True).fit(run, **channels)
    assert_array_equal(plain.coefficients, clipped.coefficients)
    assert clipped.training.clipped == ()
    assert "clipped" not in clipped.summary()


def test_members_are_clipped_too():
    delays = "0.1 s"
    spec = few(state_delays=delays, input_delays=delays, delay_rows="ridge", stable=0.95)
    ensemble = spec.fit(GROWING, *OF_ARX)
    assert_allclose(ensemble.spectral_radii(), 0.95, rtol=1e-9)
    assert len(ensemble.member(0).training.clipped) == 1
    assert "(stable, clipped to 0.95)" in ensemble.summary()
