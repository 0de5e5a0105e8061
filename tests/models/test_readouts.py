"""Channels that are read off what a model forecasts: the load of a line that falls slack."""

import json
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from seakeep import (
    BayesianHankelDMDc,
    Fixed,
    HankelDMDc,
    LogUniform,
    ReadOut,
    RequestError,
    load_model,
)
from seakeep.errors import DataError
from seakeep.models.selection import select

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from moored import DT, FLOOR, INPUTS, NOISE, PERIOD, STATES, moored_run, moored_runs, true_load

OF = ("surge", "heave", "pitch")
START, STEPS = 20.0, 400
SPEC = HankelDMDc(6, 12, 1e-3, delay_rows="exact", ridge_scale="per_snapshot")


def stern(kind: str) -> HankelDMDc:
    return replace(SPEC, readouts=[ReadOut("mooring_stern", OF, kind)])


def ensemble(**more) -> BayesianHankelDMDc:
    """Members that are all as SPEC."""
    settings = {
        "encounter_period": PERIOD * DT,
        "window": None,
        "state_delays": Fixed("0.6 T"),
        "input_delays": Fixed("1.2 T"),
        "ridge": Fixed(1e-3),
        "n_members": 1,
        "delay_rows": "exact",
        "ridge_scale": "per_snapshot",
    }
    return BayesianHankelDMDc(**settings | more)


@pytest.fixture(scope="module")
def runs():
    return moored_runs()


@pytest.fixture(scope="module")
def test_run():
    return moored_run(9)


@pytest.fixture(scope="module")
def chosen(runs):
    return replace(SPEC, readouts="auto").fit(runs, STATES, INPUTS)


def error(model, run: xr.Dataset) -> float:
    found = model.forecast(run, START, STEPS)["mooring_stern"].values
    truth = true_load(run)
    first = round(START / DT) + 1
    return float(np.sqrt(np.mean((found - truth[first : first + STEPS]) ** 2)))


class TestTruth:
    @pytest.mark.parametrize("kind", ["hinge", "stacked"])
    def test_a_slack_line_is_recovered_to_its_noise(self, runs, test_run, kind):
        linear = SPEC.fit(runs, STATES, INPUTS)
        bent = stern(kind).fit(runs, STATES, INPUTS)
        assert error(linear, test_run) > 3 * NOISE
        # The kink lies between two knots, which leaves about 0.3 N.
        assert error(bent, test_run) < NOISE
        others = [name for name in STATES if name != "mooring_stern"]
        xr.testing.assert_identical(
            bent.forecast(test_run, START, STEPS)[others],
            linear.forecast(test_run, START, STEPS)[others],
        )

    def test_auto_bends_the_slack_line_and_leaves_the_taut_one(self, chosen, test_run):
        kinds = {each.channel: each.kind for each in chosen.signature.readouts}
        assert kinds["mooring_bow"] == "none"
        assert kinds["mooring_stern"] in ("hinge", "stacked")
        assert error(chosen, test_run) < NOISE
        summary = chosen.summary()
        assert "read-out      mooring_bow: none (NRMSE on held-out runs: none 0.0" in summary
        assert f"mooring_stern: {kinds['mooring_stern']}, of surge, heave, pitch, floor" in summary
        (floor,) = [line for line in summary.splitlines() if "floor" in line]
        assert " N (NRMSE on held-out runs: none 0." in floor

    def test_auto_bends_nothing_where_no_line_is_slack(self):
        taut = moored_runs(slack=False)
        model = replace(SPEC, readouts="auto").fit(taut, STATES, INPUTS)
        assert [each.kind for each in model.signature.readouts] == ["none", "none"]
        plain = SPEC.fit(taut, STATES, INPUTS)
        run = moored_run(9, slack=False)
        xr.testing.assert_identical(
            model.forecast(run, START, STEPS), plain.forecast(run, START, STEPS)
        )

    @pytest.mark.parametrize("kind", ["hinge", "stacked"])
    def test_a_floor_is_never_undercut_and_a_taut_line_has_none(self, runs, kind):
        high = moored_run(9)
        high["eta"] = 2 * high["eta"]
        model = stern(kind).fit(runs, STATES, INPUTS)
        load = model.forecast(high, START, STEPS)["mooring_stern"].values
        # The 0.002 quantile of normal noise lies 2.9 standard deviations below.
        assert load.min() >= FLOOR - 3 * NOISE
        taut = stern(kind).fit(moored_runs(slack=False), STATES, INPUTS)
        lowest = min(float(run["mooring_stern"].min()) for run in moored_runs(slack=False).values())
        assert taut.forecast(high, START, STEPS)["mooring_stern"].values.min() < lowest

    def test_a_line_that_is_seldom_slack_rests_on_its_floor_without_a_read_out_too(self):
        low = -8.5  # N, of 2 % of the samples
        given = {f"run{seed}": moored_run(seed, samples=2000, floor=low) for seed in range(3)}
        share = np.mean([np.mean(run["mooring_stern"] < low + NOISE) for run in given.values()])
        assert 0.01 < share < 0.04
        model = replace(SPEC, readouts="auto").fit(given, STATES, INPUTS)
        line = next(each for each in model.signature.readouts if each.channel == "mooring_stern")
        high = moored_run(9)
        high["eta"] = 2 * high["eta"]
        load = model.forecast(high, START, STEPS)["mooring_stern"].values
        assert line.kind == "none"
        assert f"mooring_stern: none, floor {line.function.floor:.4g} N (NRMSE" in model.summary()
        assert low - 3 * NOISE < line.function.floor == load.min() < low
        linear = SPEC.fit(given, STATES, INPUTS).forecast(high, START, STEPS)["mooring_stern"]
        np.testing.assert_array_equal(load, np.maximum(linear, line.function.floor))


class TestOneEngine:
    @pytest.mark.parametrize("kind", ["hinge", "stacked", "auto"])
    def test_a_file_gives_the_same_bits(self, runs, test_run, kind, tmp_path):
        model = stern(kind).fit(runs, STATES, INPUTS)
        again = load_model(model.save(tmp_path / "model.nc"))
        xr.testing.assert_identical(
            again.forecast(test_run, START, STEPS), model.forecast(test_run, START, STEPS)
        )
        assert again.summary() == model.summary()
        assert again.settings == model.settings

    def test_an_ensemble_of_one_member_is_the_model(self, runs, test_run, chosen, tmp_path):
        one = ensemble(readouts="auto").fit(runs, STATES, INPUTS)
        members, single = (each.forecast(test_run, START, STEPS) for each in (one, chosen))
        for name in STATES:
            np.testing.assert_array_equal(members[name][0], single[name])
        again = load_model(one.save(tmp_path / "ensemble.nc"))
        xr.testing.assert_identical(again.forecast(test_run, START, STEPS), members)
        assert "read-out      mooring_stern" in one.summary()
        xr.testing.assert_identical(one.member(0).forecast(test_run, START, STEPS), single)

    def test_members_pass_through_it_wherever_they_run(self, runs, test_run):
        spec = ensemble(n_members=3, ridge=LogUniform(1e-4, 1e-2), readouts="auto")
        several = spec.fit(runs, STATES, INPUTS)
        expected = several.forecast(test_run, START, 50)
        assert float(expected["mooring_stern"].min()) >= FLOOR - 3 * NOISE
        elsewhere = pickle.loads(pickle.dumps(several))  # as a worker gets it
        with ThreadPoolExecutor(2) as executor:
            found = elsewhere.forecast(test_run, START, 50, executor=executor)
        xr.testing.assert_identical(found, expected)
        held = several.hold()
        xr.testing.assert_identical(held.forecast(test_run, START, 50), expected)
        k = round(START / DT)
        x = np.stack([test_run[name].values for name in STATES], axis=1)
        u = test_run["eta"].values[:, None]
        arrays = held.forecast_arrays(x[: k + 1], u[: k + 1], u[k + 1 :], 50)
        summary = several.forecast_summary(test_run, START, 50)
        np.testing.assert_allclose(  # sums over other blocks
            arrays.mean[:, 4], summary["mooring_stern"].sel(statistic="mean"), rtol=1e-9
        )

    def test_windows_and_arrays_give_the_same(self, chosen, test_run):
        alone = chosen.forecast(test_run, START, 100)
        side = chosen.forecast_windows(test_run, [START, 30.0], 100)
        k = round(START / DT)
        x = np.stack([test_run[name].values for name in STATES], axis=1)
        u = test_run["eta"].values[:, None]
        arrays = chosen.forecast_arrays(x[: k + 1], u[: k + 1], u[k + 1 :], 100)
        for column, name in enumerate(STATES):
            # Products of matrices over other blocks round differently.
            np.testing.assert_allclose(side[name][0], alone[name], rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(arrays[:, column], alone[name], rtol=1e-9, atol=1e-12)

    def test_no_linear_system_stands_for_it(self, chosen, runs, tmp_path):
        for export in (chosen.to_state_space, lambda: chosen.to_mat(tmp_path / "m.mat")):
            with pytest.raises(RequestError, match="reads mooring_stern off its other states"):
                export()
        none = replace(SPEC, readouts=[ReadOut("mooring_bow", OF)]).fit(runs, STATES, INPUTS)
        assert none.to_state_space().C.shape[0] == len(STATES)

    def test_nothing_measured_after_the_start_is_read(self, chosen, test_run):
        poisoned = test_run.copy(deep=True)
        after = poisoned["time"].values > START + 1e-9
        for name in STATES:
            poisoned[name].values[after] = np.nan
        xr.testing.assert_identical(
            chosen.forecast(poisoned, START, STEPS), chosen.forecast(test_run, START, STEPS)
        )

    @pytest.mark.parametrize("kind", ["hinge", "stacked"])
    def test_nothing_after_the_stop_of_training_is_read(self, runs, test_run, kind):
        poisoned = {name: run.copy(deep=True) for name, run in runs.items()}
        for run in poisoned.values():
            for name in (*STATES, *INPUTS):
                run[name].values[run["time"].values > 55.0 + 1e-9] = np.nan
        clean, dirty = (
            stern(kind).fit(each, STATES, INPUTS, stop=55.0).forecast(test_run, START, STEPS)
            for each in (runs, poisoned)
        )
        xr.testing.assert_identical(clean, dirty)


class TestFitting:
    def test_a_single_run_is_held_out_in_parts_and_a_short_one_not_at_all(self, runs, test_run):
        one = stern("stacked").fit(runs["run0"], STATES, INPUTS)
        assert error(one, test_run) < 2 * NOISE  # a third of the data
        short = runs["run0"].isel(time=slice(0, 300))
        model = stern("auto").fit(short, STATES, INPUTS)
        assert [each.kind for each in model.signature.readouts] == ["none"]
        assert "(no two runs could be held out to judge it)" in model.summary()
        with pytest.raises(DataError, match="free runs of 15 encounter periods on training runs"):
            stern("stacked").fit(short, STATES, INPUTS)

    def test_a_training_window_is_all_that_is_read(self, runs):
        spec = replace(stern("stacked"), window=600)
        late = {name: run.isel(time=slice(700 - 612, None)) for name, run in runs.items()}
        for chosen in (["run0", "run1", "run2"], ["run1"]):
            weights = [
                spec.fit({name: each[name] for name in chosen}, STATES, INPUTS)
                .signature.readouts[0]
                .function.weights
                for each in (runs, late)
            ]
            np.testing.assert_array_equal(*weights)

    def test_a_ridge_by_roll_out_fits_them_with_what_it_chose(self, runs, test_run):
        by_rollout = replace(stern("stacked"), ridge="rollout").fit(runs, STATES, INPUTS)
        stated = replace(stern("stacked"), ridge=by_rollout.settings.ridge).fit(
            runs, STATES, INPUTS
        )
        xr.testing.assert_identical(
            by_rollout.forecast(test_run, START, STEPS), stated.forecast(test_run, START, STEPS)
        )

    def test_settings_that_are_tuned_hold_the_kinds_that_were_chosen(self, runs):
        found = select(SPEC, runs, STATES, INPUTS, vary=("ridge", "readouts"), horizon=(15.0,))
        (only,) = found.settings.readouts
        assert only.channel == "mooring_stern"
        assert only.kind in ("hinge", "stacked")
        assert [each.kind for each in found.readouts] == ["none", only.kind]

    def test_settings_come_back_from_json(self):
        for spec in (stern("auto"), replace(SPEC, readouts="auto"), ensemble(readouts="auto")):
            again = type(spec).from_json(json.loads(json.dumps(spec.to_json())))
            assert again.readouts == spec.readouts


class TestRefused:
    @pytest.mark.parametrize(
        ("readouts", "message"),
        [
            ("all", r"readouts must be a list or 'auto'; received 'all'"),
            ([("mooring_stern", OF)], r"must hold seakeep\.ReadOut; received \('mooring_stern'"),
            (
                [{"channel": "a", "of": ["b"], "knots": 3}],
                r"unknown key 'knots'.*Keys: chan",
            ),
            ([{"channel": "a"}], r"readouts: the key 'of' is missing"),
            ([{"channel": "a", "of": ["b"]}] * 2, r"names a more than once"),
            ([{"channel": "a", "of": ["b"], "kind": "stack"}], r"a: kind must be 'hinge', 'st"),
            (
                [{"channel": "a", "of": "surge"}],
                r"a: of must be a list of one or more names; received 'surge'",
            ),
            (
                [{"channel": "a", "of": []}],
                r"a: of must be a list of one or more names; received \[\]",
            ),
            ([{"channel": "a", "of": ["b", "a"]}], r"a cannot be read off itself"),
            ([{"channel": 3, "of": ["b"]}], r"channel must be a name; received 3"),
        ],
    )
    def test_settings_out_of_range(self, readouts, message):
        with pytest.raises(RequestError, match=message):
            replace(SPEC, readouts=readouts)

    @pytest.mark.parametrize(
        ("readout", "message"),
        [
            (ReadOut("mooring", OF), r"mooring: channel names 'mooring'.*Did you mean 'mooring_"),
            (ReadOut("mooring_stern", ("sorge",)), r"of names 'sorge'.*Did you mean 'surge'"),
        ],
    )
    def test_what_is_no_state(self, runs, readout, message):
        for spec in (replace(SPEC, readouts=[readout]), ensemble(readouts=[readout])):
            with pytest.raises(RequestError, match=message):
                spec.fit(runs, STATES, INPUTS)

    def test_the_surge_that_the_alignment_follows(self):
        with pytest.raises(RequestError, match="is the surge that the model follows from step"):
            replace(
                SPEC,
                alignment={"mode": "dispersion", "surge": "predicted"},
                readouts=[ReadOut("surge", ("heave",))],
            )

    def test_cross_fitting_without_its_regression(self, runs):
        with pytest.raises(RequestError, match="takes delay_rows = 'exact' and no rank; received"):
            replace(stern("stacked"), delay_rows="ridge")
        with pytest.raises(RequestError, match=r"take ridge above zero\. Raise ridge, or"):
            replace(stern("stacked"), ridge=0.0).fit(runs, STATES, INPUTS)
        hinge = replace(stern("hinge"), delay_rows="ridge", ridge=0.0).fit(runs, STATES, INPUTS)
        assert hinge.signature.readouts[0].kind == "hinge"
