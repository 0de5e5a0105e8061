"""The blocks of CONTRIBUTING.md run as they stand: each adds one thing from outside the package."""

import re
import runpy

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from pages import page
from places import ROOT
from records import record
from said import data_error, request_error, warned
from tutorial_study import put_tutorial, studied

import seakeep
from seakeep import cli, formats, models, quality
from seakeep.baselines import FIR
from seakeep.core import Solution
from seakeep.quality import Record, as_json, findings_of, warn_of
from seakeep.study import fit_baselines

PAGE = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
DOORS = dict(re.findall(r"^### Add (.*)\n(?:(?!#).*\n)*?```python\n((?:.*\n)*?)```$", PAGE, re.M))

STUDY = """
[study]
campaign = "campaign.toml"
preset = "recommended"
[models.fading]
kind = "fading"
[models.pair]
kind = "bayesian_hankel_dmdc"
n_members = 2
ridge = { log_uniform = [0.05, 0.5] }
observables = []
readouts = {}
[tests.unseen]
runs = ["unseen"]
windows = 2
length = 4
[statistics]
n_series = 4
"""


@pytest.fixture
def add(tmp_path):
    """Run the block of a door as a module of its own; forget afterwards what it made known."""
    before = []

    def run(door, registry):
        before.append((registry, registry.copy()))
        (tmp_path / "door.py").write_text(DOORS.get(door, door), "utf-8")
        return runpy.run_path(str(tmp_path / "door.py"))

    yield run
    for registry, known in before:
        registry.clear()
        (registry.update if isinstance(known, dict) else registry.extend)(known)


def test_each_door_is_tried_here():
    assert list(DOORS) == [
        "a reader",
        "a quality check",
        "a metric",
        "a model or a baseline",
        "an observable",
        "a figure",
        "a section of the report",
    ]


@pytest.mark.parametrize("name", ["run.raw", "run.dat"])
def test_a_reader(add, tmp_path, name):
    add("a reader", formats.READERS)
    t = 0.1 * np.arange(50)
    path = tmp_path / name
    path.write_bytes(b"RAW1" + np.column_stack([t, np.sin(t)]).tobytes())
    assert_array_equal(formats.read_columns(path).values["heave"], np.sin(t))
    (tmp_path / "campaign.toml").write_text(f"[channels.heave]\n[runs.a]\nfile = '{name}'\n")
    run = seakeep.read_campaign(tmp_path / "campaign.toml").prepare()["a"]
    assert_allclose(run["heave"], 1e-3 * np.sin(t), rtol=1e-15)
    (tmp_path / "text.raw").write_text("time,heave\n0,1\n1,2\n")
    with data_error(r"text\.raw is not a valid RAW file: it holds text and starts with"):
        formats.read_columns(tmp_path / "text.raw")


def test_a_quality_check(add):
    add("a quality check", quality.CHECKS)
    time = 0.05 * np.arange(2000)
    run = record(0.05, heave=1e-4 * np.sin(time), surge=np.sin(time))
    (found,) = quality.check(Record("first", run))
    assert found.text == "has an SD of 7.1e-05 m, less than 0.001 m"
    run.attrs["quality"] = as_json([found])
    assert findings_of(run) == [found]
    with warned(r"^first: heave has an SD of .*Check the gain of"):
        warn_of([found], set())


def test_a_metric(add, run):
    mae = add("a metric", {})["mae"]
    measured = run[["heave", "pitch"]]
    found = mae(predicted=measured + 0.1, measured=measured)
    for name in measured:
        assert_allclose(float(found[name]), 0.1 / float(measured[name].std(ddof=1)))
    arrays = measured.to_dataarray("channel").values.T
    expected = [float(found[name]) for name in measured]
    assert_allclose(mae(predicted=arrays + 0.1, measured=arrays), expected)


def test_an_observable(add, tmp_path):
    slope = add("an observable", models.OBSERVABLES)["Slope"]
    eta = np.random.default_rng(0).standard_normal(600)
    heave = np.r_[0.0, 0.0, np.abs(np.diff(eta))[:-1]]  # answers the rectified slope at once
    run = record(0.1, heave=heave, eta=eta)
    spec = seakeep.HankelDMDc(0, 0, 1e-9, delay_rows="exact", observables=[slope()])
    model = spec.fit(run, ["heave"], ["eta"])
    assert model.regressors == ["eta", "slope"]
    again = seakeep.load_model(model.save(tmp_path / "slope.nc"))
    forecast = again.forecast(run, start=10.0, steps=300)
    # The moments leave out the first samples: 2 of 600.
    assert_near(forecast.heave, run.heave.sel(time=forecast.time), 5e-3)


OWN = page("howto/own_method.md").partition("```python\n")[2].partition("```")[0]


def test_a_method_of_your_own_is_the_filter_that_it_says_and_errors_name_it(add, run, tmp_path):
    pytest.importorskip("sklearn")
    Own = add(OWN, models.KINDS)["Own"]
    states = ["heave", "pitch"]
    for scale in ("absolute", "per_snapshot"):
        given = {"ridge": 2.0, "ridge_scale": scale, "lead": 2}
        own = Own(0, 8, **given).fit(run, states, ["eta_cog"])
        fir = FIR(8, **given).fit(run, states, ["eta_cog"])
        # Normal equations of another order.
        assert_near(own.coefficients, fir.coefficients, 1e-9)
    put_tutorial(
        tmp_path,
        STUDY.replace(
            'kind = "fading"', 'kind = "own"\ninput_delays = 8\nridge = 1.0\nstate_delays = 0'
        ),
    )
    campaign = seakeep.read_campaign(tmp_path / "campaign.toml")
    with warned("'subspace' is left out"):
        assert "own" not in fit_baselines(campaign, states, ["eta_fwd"])

    for wrong in (np.zeros((1, 2)), np.full((2, 11), np.nan)):
        Own.solve = lambda self, data, given=wrong: Solution(given, "own", 0.0, 1)
        with request_error(r"'own' .*; finite ones of shape \(2, 11\) are"):
            Own(0, 8, 1.0).fit(run, states, ["eta_cog"])

    def failing(self, data):
        raise ValueError("it does not converge")

    Own.solve = failing
    with pytest.raises(ValueError, match="it does not converge") as caught:
        studied(tmp_path)
    assert "model 'fading'" in caught.value.__notes__[0]
    assert cli._unforeseen(caught.value).startswith(f"{caught.value.__notes__[0]}: ValueError: it")


def test_a_model_a_figure_and_a_section_in_the_report_of_a_study(add, run, tmp_path):
    pytest.importorskip("matplotlib")
    from seakeep.report.sections import SECTIONS, write_report
    from seakeep.study import read_result

    fading = add("a model or a baseline", models.KINDS)["Fading"]
    again = seakeep.load_model(fading().fit(run, ["heave", "pitch"]).save(tmp_path / "fading.nc"))
    forecast = again.forecast(run, start=10.0, steps=2)
    start, mean = run.heave.values[200], float(run.heave.mean())
    assert_allclose(forecast.heave.values[1], mean + 0.99**2 * (start - mean))
    assert again.summary().startswith("The state at the start, fading to the mean, dt 0.05 s")

    add("a figure", SECTIONS)
    add("a section of the report", SECTIONS)
    del SECTIONS[:-2]  # the others take their time
    put_tutorial(tmp_path, STUDY)
    studied(tmp_path)
    text = write_report(read_result(tmp_path / "out")).read_text("utf-8")
    assert (tmp_path / "out/figures/sizes.svg").exists()
    assert (tmp_path / "out/tables/members.csv").read_text("utf-8").splitlines()[1:] == ["pair,2"]
    assert '<li><a href="#sizes">' in text
    assert '<section id="members"><h2>Sizes of ensembles</h2>' in text


def test_the_page_names_the_rooms_of_the_house():
    table = PAGE[PAGE.index("| room, from the top |") : PAGE.index("Reasons for this order")]
    rows = [line.split("|")[1] for line in table.splitlines()[2:] if line.startswith("|")]
    named = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    source = ROOT / "src/seakeep"
    found = {path.stem for path in source.glob("*.py")} | {
        path.parent.name for path in source.glob("*/__init__.py")
    }
    assert sorted(named) == sorted(found - {"__init__", "__main__"})
