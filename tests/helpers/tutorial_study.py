"""A study of one's own on the tutorial's campaign."""

import shutil

import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal
from places import ROOT

from seakeep.models.labelled import nearest_sample
from seakeep.study import read_study, run_study

TUTORIAL = ROOT / "docs/tutorial"
STUDY = """
[study]
campaign = "campaign.toml"
preset = "recommended"
seed = 3

[training]
windows = 2

[models.deterministic]
ridge = 0.15
observables = []
readouts = {}

[models.bayesian]
kind = "bayesian_hankel_dmdc"
n_members = 4
ridge = { log_uniform = [0.05, 0.5] }
observables = []
readouts = {}
window = { uniform = ["10 T", "20 T"] }

[tests.unseen]
runs = ["unseen"]
windows = 3
length = 6

[statistics]
n_series = 8
"""
"""Seconds, and all parts of a study."""


def put_tutorial(folder, study=STUDY):
    """Put the tutorial's campaign and a study of it into a folder."""
    for path in TUTORIAL.glob("*"):
        if path.suffix in (".toml", ".csv"):
            shutil.copy(path, folder)
    (folder / "study.toml").write_text(study, "utf-8")


def study_of(folder):
    return read_study(folder / "study.toml")


def studied(folder):
    """Result of the study in a folder."""
    return run_study(study_of(folder), folder / "out")


def edit(path, *pairs):
    """Replace texts of a file, which must stand in it."""
    text = path.read_text("utf-8")
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, "utf-8")
    return path


def assert_same(first, second):
    """Compare the results of a study array by array."""
    assert first.groups.keys() == second.groups.keys()
    for name, group in first.groups.items():
        xr.testing.assert_identical(group, second.groups[name])


def assert_cells_are_what_the_models_say(found, plan, **near):
    """Compare the forecasts of every window of a study with those of its models alone."""
    for number, training in enumerate(plan.training):
        taught, runs = plan.taught(training.spans), plan.runs
        single, ensemble = (spec.fit(*taught) for spec in plan.specs.values())
        ((name, begin, stop),) = training.spans
        part = runs[name].sel(time=slice(begin - 1e-6, stop + 1e-6))
        for test, windows in plan.tests.items():
            for k, window in enumerate(windows):
                run = runs[window.run]
                cell = found.tests[test].isel(training=number, window=k)
                assert (cell["lost"] == -1).all()  # no member is lost
                alone = single.forecast(run, window.start, window.steps)
                band = ensemble.forecast_summary(run, window.start, window.steps, level=0.95)
                at = nearest_sample(run["time"].values, window.start, window.run) + 1
                for channel in plan.states:
                    ours = cell.sel(channel=channel)
                    spread = part[channel].values.std(ddof=1)
                    assert_allclose(ours["training_std"], spread, rtol=1e-9)
                    assert_allclose(ours["mean"].sel(model="deterministic"), alone[channel], **near)
                    ours = ours.sel(model="bayesian", ensemble="bayesian")
                    for key in ("mean", "std", "lower", "upper"):
                        assert_allclose(ours[key], band[channel].sel(statistic=key), **near)
                    measured = run[channel].values[at : at + window.steps]
                    assert_array_equal(ours["measured"], measured)
