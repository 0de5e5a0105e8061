"""A study runs, resumes after a kill, and says what is wrong with what it is given."""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from said import data_error, request_error, warned
from tutorial_study import (
    assert_cells_are_what_the_models_say,
    assert_same,
    put_tutorial,
    study_of,
)

from seakeep import DataError, RequestError
from seakeep.executor import processes
from seakeep.statistics import split_bands
from seakeep.study import read_study, run_study
from seakeep.study.describe import describe_study, words_of_repeats
from seakeep.study.judge import joined
from seakeep.study.plan import make_plan, warn_of_slow_study
from seakeep.study.run import compute, compute_task, facts_of, tasks_of, units_of
from seakeep.study.store import LOCK, RESULT, UNITS, UnitFolder

CELL = {"cell": xr.Dataset({"mean": ("time", np.arange(3.0)), "words": "Åsgård"})}


@pytest.fixture(scope="module")
def finished_once(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    put_tutorial(folder)
    with processes(1) as pool:
        return run_study(study_of(folder), folder / "out", executor=pool)


@pytest.fixture
def finished(study_folder, finished_once):
    """The result, its files copied so that a test may spoil them."""
    folder = study_folder / "out"
    shutil.copytree(finished_once.folder, folder)
    return replace(finished_once, folder=folder)


def assert_was_finished(study, folder, finished):
    told = []
    assert_same(finished, run_study(study, folder, progress=lambda *each: told.append(each[2])))
    assert told == ["finished before"]


def test_cells_are_what_the_models_say(study_folder, finished):
    plan = make_plan(study_of(study_folder))
    # Windows side by side are one product: sums in another order, about 1e-13.
    assert_cells_are_what_the_models_say(finished, plan, rtol=1e-9, atol=1e-11)


def test_the_error_over_time_is_kept_in_bands_and_its_growth_is_that_of_each_channel(finished):
    test, trend = finished.tests["unseen"], finished.groups["statistics/trend"].sel(test="unseen")
    cell = test.isel(training=1, window=2)
    p, m = cell["mean"].sel(model="bayesian").values, cell["measured"].values
    # The default: three periods.
    parts = split_bands(p - m, finished.attrs["dt"], 1 / (3 * finished.attrs["encounter_period"]))
    found = [np.mean(np.abs(part) / m.std(axis=0, ddof=1), axis=1) for part in parts]
    bands = cell["error_over_time"].sel(model="bayesian", band=["low", "wave"])
    assert_allclose(bands, found, rtol=1e-12)  # means of few channels
    mean = test["error_over_time"].mean(("training", "window"))
    assert_allclose(*xr.align(trend["error_mean"].transpose(*mean.dims), mean))
    cell = cell.sel(model="deterministic")
    error = np.abs(cell["mean"] - cell["measured"]) / cell["measured"].std("time", ddof=1)
    age = cell["time"] - cell["time"][0]
    slope = error.polyfit("time", 1)["polyfit_coefficients"].sel(degree=1) * float(age[-1])
    # A line of least squares and a mean, summed in another order.
    at = cell.sel(band="all")
    assert_allclose(at["growth"], slope, rtol=1e-9)
    assert_allclose(at["level"], error.mean("time"), rtol=1e-12)


def test_a_study_that_is_interrupted_goes_on_and_ends_the_same(study_folder, finished):
    study, out, told = study_of(study_folder), study_folder / "stopped", []

    def stop(done, total, what):
        if done == 3 and "training set" in what:  # both models of one, and one of the next
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(study, out, progress=stop)
    assert len(list((out / UNITS).iterdir())) == 3
    assert not (out / "study.nc").exists()
    for name in (f"{UNITS}/.half.nc.tmp", "notes.tmp"):
        (out / name).write_bytes(b"\x89H")
    with warned(r"removed 1 unfinished file\(s\) of a killed run"):
        again = run_study(study, out, progress=lambda *each: told.append(each))
    assert (out / "notes.tmp").exists()
    assert next(each[0] for each in told if each[2] == "fitting and forecasting") == 3
    assert_same(finished, again)


def test_one_process_works_in_a_folder(study_folder, finished):
    study, out = study_of(study_folder), study_folder / "shared"
    refused = []

    def second(done, total, what):
        if what == "statistics and densities":
            with request_error(r"another process works on the study in .*sha"):
                run_study(study, out)
            refused.append(what)

    assert_same(finished, run_study(study, out, progress=second))  # without workers
    assert refused
    assert not (out / LOCK).exists()
    assert_was_finished(study, out, finished)


@pytest.mark.parametrize("change", [lambda x: x[:40], lambda x: x[:130] + b"4" + x[131:]])
def test_a_damaged_unit_is_computed_again(change, tmp_path):
    units = UnitFolder(tmp_path, "digest")
    units.check()
    units.write("one", CELL)
    xr.testing.assert_identical(units.read("one")["cell"], CELL["cell"])
    path = tmp_path / UNITS / "one.nc"
    path.write_bytes(change(path.read_bytes()))
    assert units.read("one") is None


def test_a_folder_without_a_finished_unit_belongs_to_no_study(tmp_path):
    first, second = (UnitFolder(tmp_path, digest) for digest in ("one", "two"))
    first.check()
    second.check()
    second.write("cell", CELL)
    second.check()
    (tmp_path / UNITS / "a damaged one.nc").write_bytes(b"")
    with request_error("holds the results of another study: its digest starts with two"):
        first.check()


def test_units_of_other_versions_are_not_mixed_with_those_of_this_one(tmp_path, monkeypatch):
    units = UnitFolder(tmp_path, "one")
    units.check()
    units.write("cell", CELL)
    monkeypatch.setattr("seakeep.study.store.versions", lambda: {"numpy": "3.0"})
    with request_error(r"was started with numpy .* \(now 3.0\); arrays of both would be mixed"):
        units.check()


def test_a_finished_study_says_itself_which_it_is(study_folder, finished, tmp_path):
    study = study_of(study_folder)
    shutil.copy(finished.folder / RESULT, tmp_path)
    assert_was_finished(study, tmp_path, finished)
    with request_error("holds the results of another study"):
        UnitFolder(tmp_path, "two").check()
    (tmp_path / RESULT).write_bytes(b"")
    with data_error("was cut off, altered or damaged"):
        UnitFolder(tmp_path, study.digest).check()


@pytest.mark.parametrize(
    ("result", "words"),
    [(f"{UNITS}/one.nc", "none of them says of which study"), (RESULT, "it has no checksum")],
)
def test_results_that_name_no_study_are_not_overwritten(result, words, tmp_path):
    (tmp_path / UNITS).mkdir()
    (tmp_path / result).write_bytes(b"")
    with pytest.raises((RequestError, DataError), match=words):
        UnitFolder(tmp_path, "one").check()


def test_the_smallest_study_tests_runs_that_do_not_state_their_waves(study_folder):
    path = study_folder / "study.toml"
    path.write_text('[study]\ncampaign = "campaign.toml"\n', "utf-8")
    assert {window.run for window in make_plan(read_study(path)).tests["irregular"]} == {"unseen"}
    path.write_text(path.read_text("utf-8") + '[tests.regular]\nwaves = "regular"\n', "utf-8")
    with request_error(r"not stated: irregular.*State the waves of a run"):
        make_plan(read_study(path))


def test_models_that_no_window_judges_are_named(study_folder):
    path = study_folder / "study.toml"
    scheme = 'scheme = "leave_out"\nleave_out = "run"\nruns = ["first", "second", "unseen"]'
    text = '[study]\ncampaign = "campaign.toml"\n[training]\n{}\n[tests.all]\nwindows = {}\n'
    path.write_text(text.format(scheme, 3), "utf-8")
    assert len({window.run for window in make_plan(read_study(path)).windows}) == 3
    path.write_text(text.format(scheme, 2), "utf-8")
    with warned(r"for the training sets without \w+, whose.*least 3"):
        plan = make_plan(read_study(path))
    assert len({window.run for window in plan.windows}) == 2


def test_joined_series_are_the_windows_end_to_end(finished):
    test = finished.tests["unseen"].copy(deep=True)
    predicted, measured, diverged = joined(test, "bayesian")
    assert diverged == 0
    assert predicted.shape == (2, 3 * test.sizes["time"], test.sizes["channel"])
    assert_array_equal(measured[: test.sizes["time"]], test["measured"][0])
    assert_array_equal(predicted[1, -1], test["mean"].sel(model="bayesian")[1, -1, -1])
    # A window that one training set tests has the same forecast in all series.
    test["judged"][0, 0] = False
    mean, steps = test["mean"].sel(model="bayesian"), test.sizes["time"]
    predicted, *_ = joined(test, "bayesian")
    assert_array_equal(predicted[:, :steps], np.stack([mean[1, 0], mean[1, 0]]))
    assert_array_equal(predicted[:, steps : 2 * steps], mean[:, 1])


OPEN = """
[study]
campaign = "campaign.toml"
preset = "recommended"

[training]
scheme = "pooled"

[models.deterministic]
kind = "hankel_dmdc"

[models.bayesian]
kind = "bayesian_hankel_dmdc"
n_members = 2

[models.mean]
kind = "mean"

[tests.unseen]
runs = ["unseen"]
windows = 1
length = 6
"""


def test_a_single_model_and_an_ensemble_share_what_is_chosen_on_a_training_set(tmp_path):
    put_tutorial(tmp_path, OPEN)
    study = study_of(tmp_path)
    plan = make_plan(study)
    facts = facts_of(study, plan)
    single, ensemble, mean = units_of(plan)
    assert tasks_of(plan, [single, ensemble, mean]) == [(single, ensemble), (mean,)]
    both = compute_task((plan, facts), (single, ensemble))
    for unit, found in zip((single, ensemble), both, strict=True):
        alone = compute(plan, facts, unit)
        assert found.keys() == alone.keys()
        for name, group in found.items():
            xr.testing.assert_identical(group, alone[name])


def described(folder):
    study = study_of(folder)
    return describe_study(study, make_plan(study))


def test_a_run_that_was_learnt_from_is_found_and_named(study_folder):
    files = sorted(study_folder.glob("*.csv"))
    files[-1].write_bytes(files[0].read_bytes())  # the test run is a training run
    with warned("^unseen: file is one of first too"):
        found = described(study_folder)["repeats"]
    assert list(found["run"].values) == ["unseen"]
    assert found["share"].item() > 0.5  # as far as the last of two random windows reaches
    assert_near(found["correlation"], 1.0, 1e-3)
    words = words_of_repeats(found)
    assert words.startswith("The input 'eta_fwd' of unseen repeats training input: ")
    assert words.endswith(
        "turned by 0 degrees (correlation 1.000). Tests there show memory, not skill."
    )


def test_seas_of_their_own_repeat_nothing(study_folder):
    assert "repeats" not in described(study_folder)


DRIFT = 60.0
"""Period of the drift put onto heave, s: the two training runs hold four periods in all."""


def test_a_study_with_short_windows_is_told_once(study_folder, monkeypatch):
    """The tutorial's runs, their heave on a slow drift three times as large as the waves."""
    for path in study_folder.glob("*.csv"):
        table = pd.read_csv(path, sep=";")
        time, heave = table.iloc[:, 0], table.filter(like="HEAVE").columns
        size = 3 * np.sqrt(2) * table[heave].std()
        table[heave] += np.outer(np.sin(2 * np.pi * time / DRIFT), size)
        table.to_csv(path, sep=";", index=False, float_format="%.6g")
    study = study_of(study_folder)
    plan = make_plan(study)
    with warned(r"slow motion of heave \(period [56]\d") as caught:
        warn_of_slow_study(plan)
    assert len(caught) == 1
    assert "windows of 'bayesian' in" in str(caught[0].message)  # 20 T at most
    monkeypatch.setattr("seakeep.study.run._computed", lambda *_: pytest.fail("told before"))
    with warned("slow motion"), pytest.raises(pytest.fail.Exception):
        run_study(study, study_folder / "out")
