"""Bands of a study calibrated on training data: with 'recommended' by default, never on tests."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tutorial_study import edit, studied

from seakeep.study import read_study
from seakeep.study.plan import make_plan
from seakeep.study.run import Unit, compute, facts_of


def edited(folder, *changes):
    return read_study(edit(folder / "study.toml", *changes))


def test_margins_and_coverage_of_a_study_are_those_of_its_ensembles(study_folder):
    stated = ("n_series = 8", 'n_series = 8\nscale = "learnt"')
    study = edited(study_folder, ("length = 6", "length = 3"), stated)
    found, plan = studied(study_folder), make_plan(study)
    kept = found.groups["calibration"].sel(ensemble="bayesian")
    steps = plan.tests["unseen"][0].steps
    inside = []
    for k, training in enumerate(plan.training):
        ensemble = plan.specs["bayesian"].fit(*plan.taught(training.spans))
        parts = {name: plan.runs[name] for name in ("first", "second")}  # they train as a whole
        calibrated = ensemble.calibrate(parts, steps, scale="learnt")
        alone = calibrated.calibration
        assert_allclose(kept["margin"][k], alone.conformal.margin, rtol=1e-9)
        assert kept["windows"][k] == sum(alone.windows.values()) > 0
        for window in plan.tests["unseen"]:
            run = plan.runs[window.run]
            band = calibrated.forecast_summary(run, window.start, steps, band="calibrated")
            for name in plan.states:
                lower, upper = (band[name].sel(statistic=key) for key in ("lower", "upper"))
                measured = run[name].sel(time=band["time"], method="nearest").values
                inside.append(((lower <= measured) & (measured <= upper)).mean())
    by_channel = np.reshape(inside, (-1, len(plan.states))).mean(axis=0)
    table = found.groups["statistics/coverage"].sel(
        test="unseen", model="bayesian", against="measured"
    )
    inside = table["inside"].sel(band="calibrated")[1:]
    assert_allclose(inside, by_channel, rtol=1e-9)
    members, calibrated = table["relative_width"]
    assert (calibrated > members).all()
    bands = found.groups["statistics/bands"].sel(test="unseen", model="bayesian", band="calibrated")
    # Parts by wave height are thirds of the same instants.
    thirds = bands["crps"].sel(part=["lowest waves", "middle waves", "highest waves"])
    assert_allclose(thirds.mean("part"), bands["crps"].sel(part="all"))


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
    plan = make_plan(study)
    runs = plan.runs
    (fold,) = (k for k, each in enumerate(plan.training) if each.left_out == ("unseen",))

    def margins(given):
        facts = facts_of(study, plan)
        return compute(replace(plan, runs=given), facts, Unit("bayesian", fold))["calibration"]

    found = margins(runs)
    steps = plan.tests["unseen"][0].steps
    rest = {name: runs[name] for name in ("first", "second")}
    windows = sum((run.sizes["time"] - 1 - plan.needs.history) // steps for run in rest.values())
    # An ensemble's history may be shorter than the longest that its priors allow.
    assert windows <= found["windows"] <= windows + 2
    spoilt = runs["unseen"].copy(deep=True)
    for name in plan.states:
        spoilt[name].values[:] = 1e6
    assert_array_equal(margins({**runs, "unseen": spoilt})["margin"], found["margin"])
    # The margin of one run alone is another: both count.
    fewer = {**runs, "second": runs["second"].map(lambda each: each * 1.5, keep_attrs=True)}
    assert (margins(fewer)["margin"] != found["margin"]).any()


@pytest.mark.parametrize(
    ("training", "unread", "judged"),
    [
        ('scheme = "pooled"\nruns = ["first"]', {"pooled": False}, False),
        (
            'scheme = "leave_out"\nruns = ["first", "second", "unseen"]',
            {"without first": False, "without second": False, "without unseen": True},
            True,
        ),
    ],
)
def test_sets_without_a_window_that_is_not_read_or_tests_have_no_margin(
    study_folder, training, unread, judged
):
    edited(
        study_folder,
        ("windows = 2\n\n[models", f"{training}\n\n[models"),
        ('window = { uniform = ["10 T", "20 T"] }\n', ""),
    )
    found = studied(study_folder)
    kept = found.groups["calibration"].sel(ensemble="bayesian")
    assert list(kept["training"].values) == list(unread)
    windows = kept["windows"].values > 0
    assert windows.tolist() == list(unread.values())
    assert_array_equal(kept["margin"].notnull().all("channel"), windows)
    table = found.groups["statistics/coverage"].sel(
        test="unseen", channel="average", against="measured"
    )
    members, calibrated = table["inside"].transpose("band", ...)
    assert bool(np.isfinite(calibrated).all()) is judged
    assert np.isfinite(members).all()
