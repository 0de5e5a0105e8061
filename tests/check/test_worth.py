"""The first screen: error beside baselines, and a verdict that follows from it."""

from dataclasses import replace

import numpy as np
import pytest
from moored import moored_run
from numpy.testing import assert_allclose

from seakeep import HankelDMDc, metrics
from seakeep.baselines import FIR, Mean
from seakeep.check import Checked, check_model, validity, worth
from seakeep.check.parts import free_runs
from seakeep.report.check_page import check_sections
from seakeep.study import training_runs

STATES = ["surge", "heave"]


def part(seed, **attrs):
    return moored_run(seed).assign_attrs(attrs)


@pytest.fixture(scope="module")
def runs():
    span = (0.0, 69.9)
    lost = part(4, test_span=span)
    noise = np.random.default_rng(0).standard_normal(lost.sizes["time"])
    lost["surge"] = (lost.surge + 3 * float(lost.surge.std()) * noise).assign_attrs(units="m")
    return {
        "train": part(2, train_span=span),
        "one": part(3, test_span=span),
        "two": lost.assign_attrs(waves="regular"),
    }


@pytest.fixture(scope="module")
def model(runs):
    return HankelDMDc(2, 4, 1e-6, delay_rows="exact").fit({"train": runs["train"]}, STATES, ["eta"])


@pytest.fixture(scope="module")
def baselines(runs):
    train = {"train": runs["train"]}
    return {"mean": Mean().fit(train, STATES), "fir": FIR(0).fit(train, STATES, ["eta"])}


@pytest.fixture(scope="module")
def checked(model, runs, baselines):
    return check_model(model, runs, None, baselines)


def test_a_decay_in_still_water_is_no_test_in_irregular_waves(model, runs):
    both = runs | {"decay": part(5, waves="still", test_span=(0.0, 69.9))}
    assert [*worth(model, both)["run"].values] == ["one", "two"]
    assert [*validity(model, both)["run"].values] == [*runs]


def test_errors_are_those_of_the_tests_and_verdicts_follow_from_them(model, runs, checked):
    found = checked.results["worth"]
    assert found.attrs["of"] == "tests"
    assert [*found["run"].values] == ["one", "two"]
    free = free_runs(model, {"one": runs["one"]})["one"]
    known = metrics.anrmse(predicted=free.forecast, measured=free.measured)
    assert_allclose(found.anrmse.sel(model="model", run="one"), known)
    assert_allclose(found.run_nrmse.sel(run="one").values.mean(), known)
    calm, rough = found.sel(waves="irregular"), found.sel(waves="regular")
    assert calm.limit.values.tolist() == [0.1, 0.1, 0.1]
    assert calm.better.all()
    assert rough.limit.sel(state="surge") == np.inf  # nine tenths of it are noise
    for key, of in (("nrmse", "model"), ("change", "fir")):
        low, value, high = (found[f"{key}{end}"].sel(model=of) for end in ("_lower", "", "_upper"))
        assert ((low < value) & (value < high)).all()
    ratio = calm.nrmse.sel(model="model") / calm.nrmse.sel(model="fir") - 1
    assert_allclose(calm.change.sel(model="fir").values, ratio.values)


def test_training_is_judged_apart(model, runs, checked):
    found = checked.results
    assert found["residuals"].attrs["of"] == "tests"
    assert found["training_residuals"].attrs["of"] == "training"
    alone = check_model(model, {"train": runs["train"]})
    assert "training_residuals" not in alone.results
    assert check_sections(alone)[0].points[0].startswith("No run tests the model.")


def test_a_run_without_spans_trains_where_its_role_says_so(model, runs):
    stated = {name: run.drop_attrs(deep=False) for name, run in runs.items()}
    stated["train"].attrs["role"] = "train"
    found, expected = (worth(model, {**of, "two": runs["two"]}) for of in (stated, runs))
    assert found.equals(expected)
    assert worth(model, {"train": stated["train"]}).attrs["of"] == "training"
    whole = training_runs(stated)["train"]
    assert [*training_runs(stated)] == ["train"]
    assert whole.equals(runs["train"])


def worded(found, **more):
    return check_sections(Checked({"worth": found}, {}, {}, **more))[0].points


def test_a_baseline_that_is_lost_does_not_count_and_is_named(model, runs, baselines):
    fir = baselines["fir"]
    wild = replace(fir, coefficients=1e9 * fir.coefficients)
    found = worth(model, runs, {**baselines, "subspace": wild})
    assert found.sel(waves="irregular").better.all()
    points = worded(found)
    assert any("subspace: its forecast of one, two diverges" in each for each in points)
    assert "not shown" not in " ".join(each for each in points if "heave" in each)


def test_a_baseline_that_reads_a_longer_history_counts(model, runs):
    longer = FIR(40).fit({"train": runs["train"]}, STATES, ["eta"])
    assert "longer" in worth(model, runs, {"longer": longer})["model"]


@pytest.mark.parametrize(
    ("low", "words"),
    [
        (0.22, "; worse than the baseline fir (+22 to +71 %)."),
        (-0.03, "; not shown to be better than the baseline fir (−3 to +71 %)."),
    ],
)
def test_worse_than_a_baseline_is_said(checked, low, words):
    found = checked.results["worth"].copy(deep=True)
    found["better"][:], found["rival"][:] = False, "fir"
    found["change_lower"][:], found["change_upper"][:] = low, 0.71
    text = next(each for each in worded(found) if each.startswith("Irregular waves, surge"))
    assert text.endswith(words)


def test_what_repeats_training_and_what_stands_still_are_said(model, runs):
    flat = runs["one"].assign(heave=(0 * runs["one"].heave).assign_attrs(units="m"))
    points = worded(worth(model, {"one": flat}), repeats={"one": "77 % of it"})
    assert any("heave: cannot be judged: it stands still" in each for each in points)
    assert all("(memory, not skill: one repeat" in e for e in points if e.startswith("Irreg"))
