"""Alignment of the wave input in fit and forecast: a vessel that drifts, probes that are moved."""

import numpy as np
import pytest
import xarray as xr
from drifting import FOLLOWED, INPUTS, POSITIONS, STATES, drifting_run, heave_error
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from said import data_error

from seakeep import HankelDMDc, ProbeAlignment, estimate_probe_offset
from seakeep.models.labelled import Span


def spec(alignment):
    return HankelDMDc(10, 40, 1e-3, delay_rows="exact", alignment=alignment)


@pytest.fixture(scope="module")
def models(drifts):
    settings = {
        "none": None,
        "rest": ProbeAlignment(mode="dispersion", surge="none"),
        "dispersion": ProbeAlignment(mode="dispersion", surge="measured"),
        "effective": ProbeAlignment(mode="effective", surge="measured"),
        "predicted": FOLLOWED,
    }
    return {key: spec(each).fit(drifts, STATES, INPUTS) for key, each in settings.items()}


def test_alignment_makes_one_linear_model_hold_wherever_the_vessel_is(models, drift):
    errors = {key: heave_error(model, drift) for key, model in models.items()}
    # Heave is linear in the elevation at the vessel: dispersion leaves the noise and the ridge.
    assert errors["dispersion"] < 0.06
    assert errors["predicted"] < 0.12  # and what the forecast of surge is off
    assert errors["effective"] < 0.5 * errors["none"]
    assert errors["none"] > 0.4
    # Waves are of 0.3 to 0.9 Hz.
    assert 0.5 < models["dispersion"].alignment.highest_frequency < 1.0
    # With no surge and no offset the elevation stays where it is, to a transform's rounding.
    assert_allclose(errors["rest"], errors["none"], rtol=1e-6)


@pytest.mark.parametrize("key", ["effective", "dispersion"])
def test_a_measured_surge_in_other_units_than_metres_is_refused(models, drifts, key):
    """Also where it is no state, whose unit the model knows."""
    in_mm = [run.assign(surge=(1000 * run["surge"]).assign_attrs(units="mm")) for run in drifts]
    model = models[key].settings.fit(drifts, ["heave"], INPUTS)
    message = r"channel 'surge' of run is in 'mm' and the model expects 'm'\. Convert"
    with data_error(message):
        model.settings.fit(in_mm, ["heave"], INPUTS)
    with data_error(message):
        model.forecast(in_mm[0], start=60.0, steps=10)


@pytest.mark.parametrize("key", ["effective", "dispersion"])
def test_elevations_are_carried_where_a_span_reads_them_alone(models, drift, key):
    found = models[key].alignment.carry(drift, [Span(300, 300, 400), Span(600, 600, 650)])
    read = np.flatnonzero(np.isfinite(found).all(axis=1))
    assert_array_equal(read, [*range(300, 400), *range(600, 650)])
    assert_array_equal(read, np.flatnonzero(np.isfinite(found).any(axis=1)))


def test_each_run_is_carried_at_its_own_celerity_unless_one_is_asked_for(drifts):
    own = [run.assign_attrs(celerity=c) for run, c in zip(drifts, (2.5, 3.0), strict=True)]
    slow = drifting_run(7).assign_attrs(celerity=2.0)
    model, common, stated = (
        spec(ProbeAlignment(mode="effective", **each)).fit(own, STATES, INPUTS)
        for each in ({}, {"celerity": "common"}, {"celerity": 2.0})
    )
    # The mean slowness of the training runs is that of no run.
    mean = 2 / (1 / 2.5 + 1 / 3.0)
    for found, expected in ((model, 2.0), (common, mean)):
        assert_allclose(found.alignment.celerity, mean)
        assert_allclose(found.alignment.celerity_of(slow), expected)
        attrs = found.forecast(slow, start=60.0, steps=10).attrs
        assert_allclose(attrs["alignment_celerity"], expected)
    xr.testing.assert_allclose(model.aligned_inputs(slow), stated.aligned_inputs(slow))
    assert_allclose(model.alignment.celerity_of(drifting_run(8)), mean)


def test_a_probe_that_was_moved_and_says_so_changes_nothing(models):
    run = drifting_run(7, moved=0.5)
    wrong = heave_error(models["dispersion"], run)
    for name, x in POSITIONS.items():
        run[name].attrs["x_position"] = x + 0.5
    assert heave_error(models["dispersion"], run) < 0.06 < 0.3 < wrong


def test_an_offset_is_found_with_its_spread(models):
    run = drifting_run(7, moved=-0.4)
    found = estimate_probe_offset(models["dispersion"], run, (0.0, 60.0))
    # 0.4 m upstream: carry 0.4 m downstream. 55 s of 27 waves with next to no noise.
    assert_near(found.offset, 0.4, 0.03)
    assert found.interval[0] - 0.01 <= found.offset <= found.interval[1] + 0.01
    assert 0 < found.spread < 0.05
    assert found.nrmse < 0.25 * found.nrmse_uncorrected
    assert heave_error(models["dispersion"], run.assign_attrs(probe_offset=found.offset)) < 0.1


def test_a_gap_in_the_surge_is_named_in_a_forecast(models):
    run = drifting_run(7)
    run["surge"].values[700] = np.nan
    with data_error(r"channel 'surge' of run has 1 missing .* at t = 70 s"):
        models["dispersion"].forecast(run, start=60.0, steps=300)
    models["dispersion"].forecast(run, start=60.0, steps=50)
