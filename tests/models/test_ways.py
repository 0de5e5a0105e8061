"""Every way to a forecast gives the same numbers, and reads no more than it says."""

import json
from dataclasses import replace

import numpy as np
import pytest
from drifting import DT, FOLLOWED, INPUTS, OBSERVABLES, drifting_run, drifting_runs
from near import assert_near
from records import arrays_at, fed, table
from said import data_error
from xarray.testing import assert_identical

from seakeep import (
    BayesianHankelDMDc,
    HankelDMDc,
    LogUniform,
    ProbeAlignment,
    Uniform,
    load_model,
)

STATES, START, STEPS = ["surge", "heave", "mooring_bow"], 600, 80
VARIANTS = {
    "regressed rows": {"delay_rows": "ridge"},
    "absolute ridge, history inside": {"ridge_scale": "absolute", "history": "inside"},
    "lead": {"lead": 6},
    "memory": {"memory": 40},
    # The ends of a record are carried otherwise than its middle.
    "measured surge": {"alignment": ProbeAlignment(surge="measured"), "window": None},
    "observables": {"lead": 6, "observables": OBSERVABLES},
    "following now": {"alignment": FOLLOWED},
    "following": {
        "alignment": FOLLOWED,
        "lead": 12,
        "observables": OBSERVABLES,
        "readouts": {"mooring_bow": "auto"},
    },
}
"""Settings beside those of all, which between them go through all that a forecast computes."""


def settings(key):
    return {"delay_rows": "exact", "ridge_scale": "per_snapshot", "window": 900} | VARIANTS[key]


@pytest.fixture(scope="module")
def runs():
    return drifting_runs(2, 1200)


@pytest.fixture(scope="module")
def run():
    return drifting_run(7, 900)


@pytest.fixture(scope="module", params=VARIANTS)
def key(request):
    return request.param


@pytest.fixture(scope="module")
def model(key, runs):
    return HankelDMDc(4, 12, 1e-3, **settings(key)).fit(runs, STATES, INPUTS, stop=110.0)


@pytest.fixture(scope="module")
def expected(model, run):
    return forecast_of(model, run)


def forecast_of(model, run):
    return model.forecast(run, START * DT, STEPS)


def reads_surge(model):
    """Whether a forecast is conditional on a surge that was measured."""
    alignment = model.settings.alignment
    return alignment is not None and alignment.surge == "measured"


def test_windows_arrays_and_service_are_the_forecast(model, run, expected):
    # The same sums in another order, of loads of 30 N.
    close = 1e-11
    several = model.forecast_windows(run, [START * DT, 50.0], STEPS)
    assert_near(table(several, STATES)[0], table(expected, STATES), close)
    carried = reads_surge(model)
    if carried:  # as a whole record, and not up to the end of the forecast
        run, close = run.assign(model.aligned_inputs(run)), 1e-6
    x, u, ahead = arrays_at(model, run, START * DT)
    assert_near(model.forecast_arrays(x, u, ahead, STEPS), table(expected, STATES), close)
    if not carried:
        served = fed(model.live(like=run), u, x).forecast(STEPS, ahead).isel(statistic=0)
        assert_near(table(served, STATES), table(expected, STATES), close)


def test_members_are_the_models_of_their_settings(key, runs, run, model, tmp_path):
    spec = BayesianHankelDMDc(
        encounter_period=1.5,
        state_delays=Uniform(f"{2 * DT} s", f"{6 * DT} s"),
        input_delays=Uniform(f"{8 * DT} s", f"{16 * DT} s"),
        ridge=LogUniform(1e-4, 1e-2),
        n_members=2,
        **settings(key) | {"window": Uniform("60 s", "90 s")},
    )
    ensemble = spec.fit(runs, STATES, INPUTS, stop=110.0)
    found = forecast_of(ensemble, run)
    for number, draw in enumerate(ensemble.members):
        names = ("ridge", "window", "state_delays", "input_delays")
        spec = replace(model.settings, **{name: getattr(draw.settings, name) for name in names})
        alone, member = spec.fit(runs, STATES, INPUTS, stop=110.0), ensemble.member(number)
        wanted, own = (forecast_of(m, run) for m in (alone, member))
        mine = found.isel(member=number)
        read = dict(model.settings.readouts)  # once for all members, with the medians of delays
        plain = [name for name in STATES if name not in read]
        # One arithmetic in another order.
        assert_near(table(mine, STATES), table(own, STATES), 1e-9)
        if model.signature.input_map.follows is None and not spec.observables:
            # Places and observables are learnt once for all members.
            assert_near(table(mine, plain), table(wanted, plain), 1e-9)
    for same in (load_model(ensemble.save(tmp_path / "e.nc")), ensemble.hold()):
        assert_identical(forecast_of(same, run), found)


def test_a_forecast_reads_its_history_and_look_ahead_and_nothing_else(model, run, expected):
    last = START + STEPS + round(expected.attrs["reads_input_until"] / DT)
    first = START + 1 - model.history_samples
    poisoned = run.copy(deep=True)
    for name in ("heave", "mooring_bow") if reads_surge(model) else (*STATES, *INPUTS):
        poisoned[name].values[(START if name in STATES else last) + 1 :] = np.nan
        poisoned[name].values[:first] = np.nan
    assert_identical(forecast_of(model, poisoned), expected)
    gone = run.copy(deep=True)
    gone[INPUTS[0]].values[last] = np.nan  # which it does read
    with data_error("missing"):
        forecast_of(model, gone)


def test_training_reads_its_window_and_nothing_else(runs, run, model, expected):
    settings = model.settings
    history = 0 if settings.history == "inside" else model.history_samples
    first = 200 - history if settings.window else 0
    found = settings.fit(
        [each.isel(time=slice(first, 1101)) for each in runs.values()], STATES, INPUTS
    )
    # BLAS sums in an order that follows the memory.
    assert_near(found.coefficients, model.coefficients, 1e-11)
    assert_near(table(forecast_of(found, run), STATES), table(expected, STATES), 1e-9)


def test_files_and_tables_of_settings_hold_it_all(model, run, expected, tmp_path):
    again = load_model(model.save(tmp_path / "m.nc"))
    assert_identical(forecast_of(again, run), expected)
    assert again.summary() == model.summary()
    assert again.settings == model.settings
    table = json.loads(json.dumps(model.settings.to_json()))
    assert type(model.settings).from_json(table) == model.settings
