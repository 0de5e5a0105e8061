"""Forecasts beyond the waves that were measured: ``ahead="predict"``."""

from dataclasses import replace

import numpy as np
import pytest
from drifting import DEPTH, FOLLOWED, INPUTS, POSITIONS, SQUARES, STATES
from ensembles import few
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from records import arrays_at, table
from xarray.testing import assert_identical

from seakeep import HankelDMDc
from seakeep.baselines import Subspace
from seakeep.models.engine import Windows
from seakeep.models.forecasts import weigh_members, weighed
from seakeep.models.growth import LeadErrors
from seakeep.models.inputs import Scale
from seakeep.signals.prediction import foresee

START, STEPS, LEAD = 20.0, 40, 6
SPEC = HankelDMDc(4, 12, 1.0, delay_rows="exact", lead=LEAD)
OWN_MEANS = replace(SPEC, centre="run")


@pytest.fixture(scope="module", params=["plain", "aligned", "observed"])
def model(request, drifts):
    settings = {
        "plain": {},
        "aligned": {"alignment": FOLLOWED},
        "observed": {"alignment": FOLLOWED, "observables": (SQUARES,)},
    }
    return replace(SPEC, **settings[request.param]).fit(drifts, STATES, INPUTS)


def up_to(run, last):
    """Samples up to the last one that is named."""
    return run.isel(time=slice(last + 1))


def unplaced(run):
    """A run that does not say where its probes stand, as arrays do not."""
    run = run.copy()
    for name in INPUTS:
        del run[name].attrs["x_position"]
    return run


def reads_until(model):
    """Sample of the last wave that a forecast reads."""
    return round(START / model.dt) + STEPS - 1 + model.lead_samples


def test_missing_waves_are_those_of_a_record_that_was_continued(model, drift):
    end = reads_until(model)
    last = end - 10
    short = up_to(drift, last)
    found = model.forecast(short, START, STEPS, ahead="predict")
    # By hand: the probes continued, everything after the start but waves thrown away.
    long = up_to(drift, end).copy(deep=True)
    waves = foresee(
        table(short, INPUTS),
        10,
        dt=model.dt,
        positions=[*POSITIONS.values()],
        depth=DEPTH,
    )
    for name, values in zip(INPUTS, waves.expected.T, strict=True):
        long[name].values[last + 1 :] = values
    expected = model.forecast(long, START, STEPS)
    # So far they err little, and weigh one; squares of what they err by move the surge.
    near = 1e-9 if len(model.regressors) == len(INPUTS) else 1e-3
    assert_near(table(found, STATES), table(expected, STATES), near)
    # What is missing counts as not there, and what lies beyond it is not read.
    gone = drift.copy(deep=True)
    for name in INPUTS:
        gone[name].values[last + 1 :] = np.nan
        gone[name].values[end + 1 :] = 1e9
    again = model.forecast(gone, START, STEPS, ahead="predict")
    assert_identical(again.assign_coords(time=found.time), found)


def test_ensembles_windows_and_arrays_predict_alike(drifts, drift):
    ensemble = few(n_members=3, lead=LEAD).fit(drifts, STATES, INPUTS)
    short = unplaced(up_to(drift, reads_until(ensemble) - 4))
    members = ensemble.forecast(short, START, STEPS, ahead="predict")
    words, since = (members.attrs[key] for key in ("status", "input_predicted_from"))
    assert_allclose(since, float(members.time[STEPS - 4]))
    assert words == f"ok, input predicted from t = {since:g} s"
    assert list(members["status"].values) == [words] * 3
    summary = ensemble.forecast_summary(short, START, STEPS, ahead="predict")
    assert summary.attrs["status"] == words
    for made in (ensemble, ensemble.member(0)):
        windows = made.forecast_windows(short, [10.0, START], STEPS, ahead="predict")
        assert np.isnan(windows["input_predicted_from"][0])
        assert windows["input_predicted_from"][1] == since
        alone = made.forecast_windows(short, [START], STEPS, ahead="predict")
        assert alone.attrs["input_predicted_from"] == since
        assert set(windows["status"].values[0].ravel()) == {"ok"}
        assert set(windows["status"].values[1].ravel()) == {words}
    reduced = ensemble.summarize_windows(short, [10.0, START], STEPS, ahead="predict")
    assert_array_equal(reduced["input_predicted_from"], windows["input_predicted_from"])
    given = *arrays_at(ensemble, short, START), STEPS
    band = ensemble.hold().forecast_arrays(*given, ahead="predict")
    assert_allclose(band.mean, table(summary, STATES)[0], rtol=1e-9)
    one, every = ensemble.member(1).forecast_arrays(*given, ahead="predict"), table(members, STATES)
    # The mean of the ensemble is weighed where its waves are predicted; a member alone is not.
    assert_allclose(one[:-4], every[1, :-4], rtol=1e-9)
    assert np.all(np.ptp(every[:, -1], axis=0) > 0)  # a band stays where waves are predicted


@pytest.mark.parametrize(
    ("spec", "positions"),
    [
        (SPEC, True),
        (SPEC, False),
        (Subspace(4, 12, 1e-3, order=6, lead=LEAD), True),
        (OWN_MEANS, True),
        (replace(OWN_MEANS, alignment=FOLLOWED), True),
    ],
)
def test_no_lead_errs_more_than_the_mean(drifts, drift, spec, positions):
    model, steps = spec.fit(drifts, STATES, INPUTS), 150
    run, zero = drift if positions else unplaced(drift), 0.0
    if model.signature.input_map.reference:  # to whose own means it returns
        run, zero = run.assign(heave=run.heave + 5.0), 5.0
    squares, mean = np.zeros((2, steps)), model.signature.state_scale.centre[1] + zero
    for at in range(max(300, model.history_samples), 1300, 50):
        start, true = float(run.time[at]), run.heave.values[at + 1 : at + 1 + steps]
        found = model.forecast(up_to(run, at), start, steps, ahead="predict")
        squares += (found.heave.values - true) ** 2, (mean - true) ** 2
    ratio = np.sqrt(squares[0] / squares[1])
    # Unweighted, it is 1.1 to 1.4 and stays so.
    assert ratio.max() < 1.01
    assert ratio[:3].max() < 0.2
    # Means before a start are not those of all of the run.
    assert_near(found.heave.values[-20:], mean, 0.01 if zero else 1e-12)


def test_where_waves_are_known_nothing_is_weighed(model):
    scale, runs = model.state_scale, 9.0 * np.random.default_rng(0).standard_normal((1, 5, 4, 2))
    known = np.array([True, True, False, False])
    mean, _, weight = weighed(runs, 0.0, scale, known, np.zeros(2))
    assert_array_equal(mean, np.where(known[:, None], runs[0, 0], scale.centre))
    assert_array_equal(weight, np.repeat(known[:, None], 2, axis=1))


def weigh(parts, claimed, predicted, histories=((0.0,),)):
    """Weigh forecasts of one state, of which training has the mean zero and the variance one."""
    one, zero, count = np.ones(1), np.zeros(1), len(histories)
    before, nothing = np.array(histories)[..., None], np.zeros((count, 1, 1))
    windows = Windows(9, before, nothing, nothing, predicted=(predicted,) * count)
    errors = LeadErrors(np.eye(1), np.full((9, 1), claimed))
    weigh_members(windows, parts, errors, Scale(zero, one, one, zero, one))


@pytest.mark.parametrize("lost", [0, 1])
def test_a_run_that_is_lost_at_last_is_weighed_before(lost):
    parts = np.full((3, 1, 1, 9, 1), -3.0)
    parts[lost, ..., -1, :] = np.nan
    weigh(parts, 9.0, 3)
    assert_allclose(parts[0, 0, 0, :, 0], [-3.0] * 3 + [0.0] * 5 + [0.0 if lost else np.nan])


def test_a_member_whose_departure_is_lost_counts_with_the_others():
    parts = np.full((3, 2, 1, 9, 1), 5.0)
    parts[:, 0] = -3.0
    parts[1, 0, :, -1] = np.nan
    weigh(parts, 9.0, 3)
    assert_allclose(parts[0, :, 0, :, 0].mean(axis=0), [1.0] * 3 + [0.0] * 6)
    assert_allclose(np.ptp(parts[0], axis=0), 8.0)


def test_a_sea_that_departs_from_training_is_forecast_on():
    # Near the mean, far on one side of it, and far on either side in turn.
    histories = [[-1.0, -1.0], [-3.0, -3.0], [-3.0, 3.0]]
    parts = np.full((3, 1, 3, 9, 1), -3.0)
    weigh(parts, 1.2, 0, histories)
    assert_allclose(parts[0, 0, :, :, 0], np.repeat([[0.0], [-3.0], [0.0]], 9, axis=1))


def test_errors_of_several_models_are_known_as_far_as_those_of_any():
    given = (1, [[3.0]]), (3, [[1.0], [1.0], [4.0]])
    both = LeadErrors.together([LeadErrors(n * np.eye(1), np.array(x)) for n, x in given])
    assert_allclose(both.residual, [[2.0]])
    assert_allclose(both.rms[:, 0] ** 2, [5.0, 5.0, 16.0])  # and never fall


def test_the_weight_of_a_forecast_falls_with_its_error_and_never_rises(model):
    scale = model.state_scale
    claimed = np.array([0.4, 0.6, 0.8, 0.7, 1.0])[:, None]  # squares over those of training
    errors, unknown = claimed * scale.spread**2, np.zeros(5, bool)
    # The mean errs more where measured states and the forecast lie far from it, not one alone.
    for forecast, before, expected in ((3, 2, 4), (-2, 3, 4), (0.5, 3, 1), (0, 0, 1)):
        runs = np.full((1, 1, 5, 2), scale.centre + forecast * scale.spread)
        weight = weighed(runs, expected * errors, scale, unknown, before * scale.spread)[2]
        assert_near(weight[:, 0], [1.0, 0.75, 0.25, 0.25, 0.0], 1e-12)


def test_arrays_and_windows_are_weighed_where_waves_are_predicted_alone(drifts, drift):
    model, start, steps = SPEC.fit(drifts, STATES, INPUTS), 40.0, 250
    # Waves are known for longer than a forecast without them is trusted.
    short = unplaced(up_to(drift, 500))
    found = model.forecast_arrays(*arrays_at(model, short, start), steps, ahead="predict")
    known = table(model.forecast(drift, start, steps), STATES)
    given = 101 - LEAD
    assert_near(found[:given], known[:given], 1e-9)
    assert_near(found[-20:, 1], model.state_scale.centre[1], 1e-12)
    windows = model.forecast_windows(short, [10.0, start], steps, ahead="predict")
    whole = model.forecast(drift, 10.0, steps)  # all waves of that window were measured
    assert_near(table(windows, STATES), [table(whole, STATES), found], 1e-9)
