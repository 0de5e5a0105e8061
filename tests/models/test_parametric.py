"""Models that vary with an attribute of their runs, against an exact family of linear systems."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from near import assert_near
from numpy.testing import assert_array_equal
from oscillators import OF_ARX, arx_run
from records import arrays_at, rms
from said import data_error, request_error, warned

from seakeep import HankelDMDc, check, load_model, tune
from seakeep.hosts.program import exportable
from seakeep.models import specs
from seakeep.models.engine import read_groups

ON_STATE = np.array([1.5, -0.9]), np.array([0.2, -0.03])
"""Of x(k) and x(k − 1): at a draught of zero, and their change per unit."""
ON_WAVE = 0.5, 0.4
SPEC = HankelDMDc(1, 0, 0.0, standardize=False, delay_rows="exact", parameter="rig.draught")
CHOSEN = HankelDMDc(
    2, 1, "rollout", delay_rows="exact", ridge_scale="per_snapshot", parameter="rig.draught"
)


def vessel(draught, seed, samples=400, noise=0.0):
    """A heave of second order whose coefficients are linear in the draught."""
    a, b = (fixed + draught * slope for fixed, slope in (ON_STATE, ON_WAVE))
    return arx_run(seed, a, [b], samples, 0.4, noise).assign_attrs(rig={"draught": draught})


def vessels(draughts, seed, *more):
    return [vessel(draught, seed + n, *more) for n, draught in enumerate(draughts)]


@pytest.fixture(scope="module")
def family():
    """Noisy runs at four draughts."""
    return vessels((0.0, 0.3, 0.6, 1.0), 30, 800, 0.05)


def error(model):
    """Of a forecast at a draught between those of the family."""
    run = vessel(0.45, 40, 800)
    return rms(model.forecast(run, 5.0, 200).heave - run.heave[51:251])


@pytest.fixture(scope="module")
def model():
    return SPEC.fit(vessels((0.0, 0.4, 1.0), 10), *OF_ARX)


def test_an_exact_family_is_recovered_between_its_members(model, tmp_path):
    run = vessel(0.7, 3)
    at = model.at(parameter=0.7)
    # Exact data: λ is the rounding of the Gram matrix, 1e-13 of its largest entry.
    assert_near(at.A[0], ON_STATE[0] + 0.7 * ON_STATE[1], 1e-8)
    assert_near(at.B[0], [ON_WAVE[0] + 0.7 * ON_WAVE[1]], 1e-8)
    forecast = model.forecast(run, start=5.0, steps=200)
    assert_near(forecast.heave, run.heave[51:251], 1e-6)
    again = load_model(model.save(tmp_path / "model.nc"))
    xr.testing.assert_identical(again.forecast(run, start=5.0, steps=200), forecast)
    assert "parameter     rig.draught, trained from 0 to 1" in again.summary()
    # Its errors are those at each value, and of the file too.
    assert_near(model.errors.rms, 0.0, 1e-6)
    served = [each.at(parameter=0.7).live(like=run).errors for each in (model, again)]
    assert_array_equal(served[0].rms, served[1].rms)
    assert_near(at.forecast_arrays(*arrays_at(at, run, 5.0), 200)[:, 0], forecast.heave, 1e-9)


def test_windows_of_several_runs_take_the_value_of_each(model):
    runs = {"shallow": vessel(0.2, 5), "deep": vessel(0.9, 6)}
    places = [("deep", 5.0), ("shallow", 6.0), ("deep", 7.0)]
    together = model.free_runs(read_groups(model.signature, runs, [(places, 50)]))[0][0]
    for (name, start), values in zip(places, together, strict=True):
        # Windows side by side are summed in another order.
        assert_near(values[:, 0], model.forecast(runs[name], start, 50).heave, 1e-12)


def test_means_follow_the_parameter():
    spec = replace(SPEC, state_delays=6, ridge=1e-4, ridge_scale="per_snapshot", standardize=True)
    runs = vessels((0.0, 0.5, 1.0), 20, 4000, 0.01)
    for run in runs:
        run["heave"].values[:] += 3.0 * run.attrs["rig"]["draught"]
    # The mean of 4,000 samples of a heave of SD 2 to 6 is known to about a tenth.
    assert_near(spec.fit(runs, *OF_ARX).at(parameter=0.75).state_mean[0], 2.25, 0.3)


def test_free_runs_choose_between_the_parameter_and_one_pooled_model(family):
    varying = CHOSEN.fit(family, *OF_ARX)
    assert varying.settings.parameter == "rig.draught"
    fixed = replace(CHOSEN, parameter="")
    pooled, nearest = (fixed.fit(runs, *OF_ARX) for runs in (family, family[1]))
    assert error(varying) < 0.5 * min(error(pooled), error(nearest))
    alike = [
        same.assign_attrs(rig=run.attrs["rig"])
        for same, run in zip(vessels([0.5] * 4, 50, 800, 0.05), family, strict=True)
    ]
    same = CHOSEN.fit(alike, *OF_ARX)
    assert same.settings.parameter == ""
    assert "a pooled one" in same.selection
    assert tune(CHOSEN, alike, *OF_ARX).settings.parameter == ""


def test_a_search_keeps_what_varies_better_and_ends_no_worse_than_it_started(family):
    start = replace(CHOSEN, ridge=1e-6)
    result = tune(start, family, *OF_ARX, vary=["state_delays"])
    assert result.settings.parameter == "rig.draught"
    assert result.note.startswith("on runs of inner values that are held out, a model that varies")
    before, after = (error(spec.fit(family, *OF_ARX)) for spec in (start, result.settings))
    assert after < 1.01 * before


def test_what_grows_in_the_trained_range_is_passed_over(model, family, monkeypatch):
    wide = replace(model, variation=replace(model.variation, high=3.3))
    a = ON_STATE[0] + 3.3 * ON_STATE[1]
    radius = np.abs(np.roots([1.0, *-a])).max()
    # As the coefficients.
    assert_near(specs.largest_radius(wide), radius, 1e-7)
    assert specs.largest_radius(model) < 1.0 < radius
    said = f"radius {specs.largest_radius(wide):.6f}, the largest at ends and middle (UNSTABLE"
    assert said in wide.summary()
    largest = specs.largest_radius
    monkeypatch.setattr(specs, "largest_radius", lambda m: 1.0 if m.variation else largest(m))
    spec = replace(SPEC, ridge="rollout", ridge_scale="per_snapshot", standardize=True)
    assert spec.fit(family, *OF_ARX).settings.parameter == ""


def test_a_check_takes_the_middle_of_the_training(model):
    with warned("the one in the middle of the training, "):
        shown = check.response(model, [1.0])
    at_centre = model.at(parameter=model.variation.centre)
    xr.testing.assert_identical(shown, check.response(at_centre, [1.0]))


def test_words(model):
    run = vessel(0.7, 3)
    with request_error(r"does not state the parameter rig\.draught"):
        model.forecast(run.assign_attrs(rig={}), 5.0, 10)
    with warned("lies outside the 0 to 1 of the training"):
        model.forecast(run.assign_attrs(rig={"draught": 1.2}), 5.0, 10)
    with request_error(r"model\.at\(parameter=…\)"):
        model.live()
    with request_error(r"varies with rig\.draught\. Export it at a value"):
        exportable(model)
    at_centre = model.at(parameter=model.variation.centre).summary().splitlines()
    assert model.summary().splitlines()[-1] == at_centre[-1]
    with request_error("does not vary with a parameter"):
        model.at(parameter=0.5).at(parameter=0.5)
    with data_error(r"all runs have rig\.draught = 0\.7"):
        SPEC.fit([run, vessel(0.7, 4)], *OF_ARX)
    with request_error("parameter takes delay_rows = 'exact'"):
        replace(SPEC, delay_rows="ridge")
