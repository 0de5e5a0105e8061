"""Bands of a study calibrated on training data: with 'recommended' by default, never on tests."""

from dataclasses import replace

import numpy as np
import pytest

from seakeep.study import read_study, run_study
from seakeep.study.plan import make_plan
from seakeep.study.units import Unit, compute, fit_training


def edited(folder, *changes):
    path = folder / "study.toml"
    text = path.read_text("utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, "utf-8")
    return read_study(path)


@pytest.mark.parametrize(
    ("preset", "stated", "expected"),
    [
        ("paper", "", False),
        ("recommended", "", True),
        ("paper", "calibrate = true", True),
        ("recommended", "calibrate = false", False),
    ],
)
def test_the_paper_has_no_calibration_unless_asked(study_folder, preset, stated, expected):
    study = edited(
        study_folder,
        ('preset = "recommended"', f'preset = "{preset}"'),
        ("n_series = 8", f"n_series = 8\n{stated}"),
    )
    assert study.settings.calibrates is expected


@pytest.mark.parametrize("scale", ["spread", "learnt"])
def test_margins_and_coverage_of_a_study_are_those_of_its_ensembles(study_folder, scale):
    stated = [] if scale == "spread" else [("n_series = 8", f'n_series = 8\nscale = "{scale}"')]
    study = edited(study_folder, ("length = 6", "length = 3"), *stated)
    found = run_study(study, study_folder / "out")
    plan, runs = make_plan(study)
    kept = found.groups["calibration"].sel(ensemble="bayesian")
    test = found.tests["unseen"]
    table = found.groups["statistics/coverage"].sel(
        test="unseen", model="bayesian", against="measured"
    )
    inside = []
    for k, training in enumerate(plan.training):
        ensemble = fit_training(plan, runs, "bayesian", training)
        parts = {name: runs[name] for name in ("first", "second")}  # they train as a whole
        steps = plan.tests["unseen"][0].steps
        alone = ensemble.calibrate(parts, steps, scale=scale).calibration
        np.testing.assert_allclose(kept["margin"][k], alone.found.margin, rtol=1e-9)
        assert int(kept["windows"][k]) == sum(alone.windows.values()) > 0
        cell = test.isel(training=k).sel(model="bayesian", ensemble="bayesian")
        lower, upper = cell["lower"] - alone.found.margin, cell["upper"] + alone.found.margin
        if scale == "spread":
            np.testing.assert_allclose(kept["floor"][k], alone.floor, rtol=1e-9)
            half = alone.found.margin * np.sqrt(cell["std"] ** 2 + alone.floor**2)
            lower, upper = cell["mean"] - half, cell["mean"] + half
        if scale == "learnt":
            np.testing.assert_allclose(kept["law"][k], alone.law, rtol=1e-6, atol=1e-9)
            band = replace(ensemble, calibration=alone)
            for number, window in enumerate(plan.tests["unseen"]):
                shown = band.forecast_summary(
                    runs[window.run], window.start, steps, band="calibrated"
                )
                for name in plan.states:
                    place = {"window": number, "channel": plan.states.index(name)}
                    lower[place] = shown[name].sel(statistic="lower").values
                    upper[place] = shown[name].sel(statistic="upper").values
        inside.append(((lower <= cell["measured"]) & (cell["measured"] <= upper)).values)
    by_channel = np.mean(inside, axis=(0, 1, 2))
    np.testing.assert_allclose(table["calibrated_inside"][1:], by_channel, rtol=1e-9)
    assert (table["calibrated_inside"] >= table["inside"]).all()
    assert (table["calibrated_relative_width"] > table["relative_width"]).all()
    bands = found.groups["statistics/bands"].sel(test="unseen", model="bayesian", band="calibrated")
    np.testing.assert_allclose(bands["inside"].sel(part="all"), by_channel, rtol=1e-9)
    thirds = bands.sel(part=["lowest waves", "middle waves", "highest waves"])
    np.testing.assert_allclose(thirds["crps"].mean("part"), bands["crps"].sel(part="all"))
    assert {"first third", "last third"} < set(bands["part"].values)


def test_where_runs_are_left_out_each_is_forecast_by_the_others_and_the_test_run_by_none(
    study_folder,
):
    study = edited(
        study_folder,
        (
            "windows = 2\n\n[models",
            'scheme = "leave_out"\nruns = ["first", "second", "unseen"]\n\n[models',
        ),
        ("length = 6", "length = 3"),
    )
    plan, runs = make_plan(study)
    (fold,) = (k for k, each in enumerate(plan.training) if each.left_out == ("unseen",))

    def margins(given):
        return compute(plan, given, Unit("bayesian", fold))["calibration"]

    found = margins(runs)
    steps = plan.tests["unseen"][0].steps
    rest = {name: runs[name] for name in ("first", "second")}
    windows = sum((run.sizes["time"] - 1 - plan.needs.history) // steps for run in rest.values())
    # An ensemble's history may be shorter than the longest that its priors allow.
    assert windows <= found["windows"] <= windows + 2
    spoilt = runs["unseen"].copy(deep=True)
    for name in plan.states:
        spoilt[name].values[:] = 1e6
    again = margins({**runs, "unseen": spoilt})
    np.testing.assert_array_equal(again["margin"], found["margin"])
    # The margin of one run alone is another: both count.
    fewer = {**runs, "second": runs["second"].map(lambda each: each * 1.5, keep_attrs=True)}
    assert (margins(fewer)["margin"] != found["margin"]).any()


def test_training_data_without_a_window_that_is_not_read_give_no_margin(study_folder):
    study = edited(
        study_folder,
        ("windows = 2\n\n[models", 'scheme = "pooled"\nruns = ["first"]\n\n[models'),
        ('window = { uniform = ["10 T", "20 T"] }\n', ""),
    )
    found = run_study(study, study_folder / "out")
    kept = found.groups["calibration"].sel(ensemble="bayesian")
    assert int(kept["windows"][0]) == 0
    assert np.isnan(kept["margin"]).all()
    table = found.groups["statistics/coverage"].sel(test="unseen")
    assert np.isnan(table["calibrated_inside"]).all()
    assert np.isfinite(table["inside"].sel(channel="average", against="measured")).all()


def test_runs_that_are_left_out_and_test_nowhere_have_no_margin(study_folder):
    study = edited(
        study_folder,
        (
            "windows = 2\n\n[models",
            'scheme = "leave_out"\nruns = ["first", "second", "unseen"]\n\n[models',
        ),
    )
    found = run_study(study, study_folder / "out")
    kept = found.groups["calibration"].sel(ensemble="bayesian")
    folds = list(kept["training"].values)
    assert folds == ["without first", "without second", "without unseen"]
    assert np.isfinite(kept["margin"]).all("channel").values.tolist() == [False, False, True]
    table = found.groups["statistics/coverage"].sel(
        test="unseen", channel="average", against="measured"
    )
    assert np.isfinite(table["calibrated_inside"]).all()
