"""Loads that are read off what a model forecasts, by the wave at their lines."""

from dataclasses import replace

import numpy as np
import pytest
from drifting import DT, FOLLOWED, INPUTS, LINE, LOAD_NOISE, away, drifting_runs
from drifting import STATES as MOTIONS
from ensembles import few
from moored import FLOOR, NOISE, moored_run, moored_runs
from moored import INPUTS as ETA
from moored import STATES as MOORED
from near import assert_near
from numpy.testing import assert_array_equal
from records import rms, table
from said import request_error
from xarray.testing import assert_identical

from seakeep import HankelDMDc
from seakeep.models import ensemble as ensembles
from seakeep.models.selection import select

STATES = [*MOTIONS, "mooring_bow"]
START, STEPS = 60.0, 300
SPEC = HankelDMDc(
    10, 40, 1e-3, delay_rows="exact", ridge_scale="per_snapshot", alignment=FOLLOWED, lead=12
)
PLAIN = HankelDMDc(6, 12, 1e-3, delay_rows="exact", ridge_scale="per_snapshot")


def bow(kind):
    return replace(SPEC, readouts={"mooring_bow": kind})


@pytest.fixture(scope="module")
def runs():
    return drifting_runs(3)


@pytest.fixture(scope="module")
def chosen(runs):
    return bow("auto").fit(runs, STATES, INPUTS)


@pytest.fixture(scope="module")
def linear(runs):
    return SPEC.fit(runs, STATES, INPUTS)


def moored(spec, **more):
    return spec.fit(moored_runs(**more), MOORED, ETA)


def kinds(model):
    return [each.kind for each in model.signature.readouts]


def error(model, run):
    found = model.forecast(run, START, STEPS)
    return rms((found - run.sel(time=found["time"]))["mooring_bow"])


def test_the_line_and_its_load_are_recovered_to_the_noise(chosen, drift):
    (line,) = chosen.signature.readouts
    assert abs(line.load.place - LINE) <= chosen.signature.input_map.follows.place.spacing / 2
    # Of measured motions: what is left is noise, and what the carriers err.
    windows = chosen.read_windows(drift, [START], STEPS)
    measured = table(drift, STATES)[601 : 601 + STEPS]
    found = line.read(measured, windows.waves[0, :, 0])
    assert LOAD_NOISE * 0.9 < rms(found - measured[:, 2]) < LOAD_NOISE * 1.5


def test_the_wave_at_the_line_is_that_of_the_tank(chosen, drift):
    wave, rate = chosen.read_windows(drift, [START], STEPS).waves[0, :, 0].T
    # From the definition of the load, where its line is wet.
    motions = 30.0 - 2.0 * drift["surge"].values + 5.0 * drift["heave"].values
    wet = (drift["mooring_bow"].values - motions)[601 : 601 + STEPS] / 200.0
    above = wet > 0.01
    assert np.count_nonzero(above) > 50
    height = wave[above] - wet[above]  # half a standard deviation, less errors of carriers
    assert height.std() < 0.1 * wave.std()
    assert_near(rate[1:-1], (wave[2:] - wave[:-2]) / (2 * DT), 0.05 * rate.std())


def test_auto_takes_what_forecasts_better_and_motions_stay(chosen, linear, drift):
    assert chosen.signature.readouts[0].kind == "wave"
    assert error(chosen, drift) < 0.5 * error(linear, drift)
    assert_identical(
        chosen.forecast(drift, START, STEPS)[MOTIONS], linear.forecast(drift, START, STEPS)[MOTIONS]
    )
    summary = chosen.summary()
    assert "read-out      mooring_bow: wave at -1.33 m" in summary
    assert "(NRMSE on held-out runs: none 0." in summary


def test_a_line_is_sought_about_the_vessel_wherever_its_surge_counts_from(chosen, runs, drift):
    spec = replace(SPEC, readouts="auto", alignment=replace(FOLLOWED, offset=-20.0))

    model = spec.fit({name: away(run, 20.0) for name, run in runs.items()}, STATES, INPUTS)
    (line,) = model.signature.readouts
    # Places that are tried are others, up to half of their step.
    step = 2 * model.signature.input_map.follows.place.spacing
    assert abs(line.load.place - 20.0 - LINE) <= step
    assert error(model, away(drift, 20.0)) < 1.2 * error(chosen, drift)


def test_a_load_in_kilonewtons_is_read_off_as_one_in_newtons(chosen, runs, drift):
    def in_kn(run):
        return run.assign(mooring_bow=(run["mooring_bow"] / 1000).assign_attrs(units="kN"))

    model = replace(SPEC, readouts="auto").fit(
        {name: in_kn(run) for name, run in runs.items()}, STATES, INPUTS
    )
    found, expected = (
        each.forecast(run, START, STEPS)["mooring_bow"]
        for each, run in ((model, in_kn(drift)), (chosen, drift))
    )
    # Values are standardised, so that units leave rounding alone.
    assert_near(1000 * found, expected, 1e-6 * float(expected.std()))


def test_auto_leaves_a_linear_load_as_it_is(runs, drift):
    dry = {}
    for seed, (name, run) in enumerate(runs.items()):
        load = 30.0 - 2.0 * run["surge"] + 5.0 * run["heave"]
        noise = np.random.default_rng(seed).standard_normal(run.sizes["time"])
        dry[name] = run.assign(mooring_bow=(load + LOAD_NOISE * noise).assign_attrs(units="N"))
    model = replace(SPEC, readouts="auto").fit(dry, STATES, INPUTS)
    assert kinds(model) == ["none"]
    assert_identical(
        model.forecast(drift, START, STEPS),
        SPEC.fit(dry, STATES, INPUTS).forecast(drift, START, STEPS),
    )


def test_far_outside_training_the_state_is_left(chosen, linear, drift):
    high = drift.assign(drift[INPUTS].map(lambda x: 20.0 * x, keep_attrs=True))
    found, plain = (each.forecast(high, START, 60)["mooring_bow"] for each in (chosen, linear))
    floor = chosen.signature.readouts[0].floor
    assert np.abs(found - np.maximum(plain, floor)).max() < 0.05 * np.abs(plain - 30.0).max()


# A channel that rests on a floor in training, whether waves are carried or not.


def test_a_floor_is_never_undercut_and_a_taut_line_has_none(monkeypatch):
    high = moored_run(9)
    high["eta"] = 2 * high["eta"]
    spec = replace(PLAIN, readouts="auto")
    model = moored(spec)
    bow, stern = model.signature.readouts
    assert (bow.kind, stern.kind, bow.acts, stern.acts) == ("none", "none", False, True)
    linear = moored(PLAIN).forecast(high, 20.0, 400)
    load = model.forecast(high, 20.0, 400)
    # The 0.002 quantile of normal noise lies 2.9 standard deviations below.
    assert FLOOR - 3 * NOISE < stern.floor < FLOOR
    assert f"mooring_stern: none, floor {stern.floor:.4g} N" in model.summary()
    assert_array_equal(load["mooring_stern"], np.maximum(linear["mooring_stern"], stern.floor))
    assert_identical(load["mooring_bow"], linear["mooring_bow"])
    assert not any(each.acts for each in moored(spec, slack=False).signature.readouts)
    ensemble = moored(few(readouts="auto"))
    monkeypatch.setattr(ensembles, "weigh_members", lambda _, parts, *__: parts[0].fill(-9.0))
    found = ensemble.forecast(high[{"time": slice(300)}], 20.0, 400, ahead="predict")
    assert np.all(found["mooring_stern"] == ensemble.signature.readouts[1].floor)
    unknown = moored(replace(spec, centre="run"))
    assert not any(each.acts for each in unknown.signature.readouts)  # on which zero?


def test_no_linear_system_stands_for_it(tmp_path):
    model = moored(replace(PLAIN, readouts="auto"))
    for export in (model.to_state_space, lambda: model.to_mat(tmp_path / "m.mat")):
        with request_error(r"reads mooring_stern off .* readouts = \{\} in"):
            export()
    without = moored(replace(PLAIN, readouts={}))  # as the message says
    assert without.to_state_space().C.shape[0] == len(MOORED)
    spec = replace(PLAIN, readouts={"mooring_bow": "auto"})
    assert moored(spec).to_state_space().C.shape[0] == len(MOORED)


def test_a_single_run_is_held_out_in_parts_and_a_short_one_not_at_all(runs):
    assert kinds(bow("auto").fit(runs["run1"], STATES, INPUTS)) == ["wave"]
    model = bow("auto").fit(runs["run1"].isel(time=slice(300)), STATES, INPUTS)
    assert kinds(model) == ["none"]
    assert "(not judged: no waves are carried, or" in model.summary()


def test_settings_that_are_tuned_hold_the_kinds_that_were_chosen(runs):
    found = select(SPEC, runs, STATES, INPUTS, vary=("ridge", "readouts"), horizon=(15.0,))
    assert found.settings.readouts == (("mooring_bow", "wave"),)
    assert [each.kind for each in found.readouts] == ["wave"]
