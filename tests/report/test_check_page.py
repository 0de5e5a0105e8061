"""``seakeep check``: the page, its files, and what it says of what cannot be judged."""

import re

import numpy as np
import pytest
import xarray as xr
from moored import moored_run
from said import request_error
from tables import rows_of
from tutorial_study import edit, put_tutorial

from seakeep import HankelDMDc, plot
from seakeep.check import Checked, check_model, statistics
from seakeep.cli import main

pytest.importorskip("matplotlib")


from seakeep.report.check_page import check_sections

SPEC = HankelDMDc(2, 4, 0.01, delay_rows="exact")


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("check")
    put_tutorial(folder, "")
    fewer = (', "heave_rate", "pitch_rate", "mooring_bow"', "")  # panels take a second each
    campaign, model = str(edit(folder / "campaign.toml", fewer)), str(folder / "model.nc")
    assert main(["fit", campaign, "-o", model]) == 0
    assert main(["check", model, campaign, "-o", str(folder / "out")]) == 0
    return folder / "out"


def test_the_page_holds_its_figures_and_tables(checked):
    page = (checked / "report.html").read_text("utf-8")
    assert page.index('id="worth"') < page.index('id="response"')
    for name in (
        "response",
        "coherence",
        "decay",
        "modes",
        "residuals",
        "exceedance",
        "density",
        "validity",
    ):
        assert (checked / "figures" / f"{name}.png").exists()
        assert f'id="figure-{name}"' in page
    rows = rows_of(checked / "tables" / "possible.csv")
    assert {"heave", "pitch"} == {row["state"] for row in rows}
    for row in rows:
        assert 0 < float(row["linear bound"]) <= 1
        assert f"{row['state']}: model" in page


def test_a_forecast_compares_its_waves_with_those_of_training(checked, monkeypatch, command):
    asked = []
    monkeypatch.setattr("seakeep.study.fit.warn_of_waves", lambda *given: asked.append(given[2:]))
    folder = checked.parent
    words = ["--run", "unseen", "--start", 20, "--steps", 40, "-o", folder / "forecast.csv"]
    command("forecast", folder / "model.nc", folder / "campaign.toml", *words)
    assert asked == [("unseen", 20.0, 40)]


def test_a_motion_that_swings_farther_than_it_was_moved_is_named():
    left = np.array([[1.0, -0.8, 0.5, -0.3], [1.0, -3.04, 2.0, -0.9]])
    none = ("motion", [np.nan, np.nan])
    found = xr.Dataset(
        {
            "displacement": (("motion", "time"), left),
            **dict.fromkeys(("period", "damping_ratio", "p"), none),
        },
        coords={"motion": ["heave", "pitch"], "time": np.arange(4.0)},
    )
    keys = ("period", "damping_ratio", "decay_time", "modulus")
    slow = xr.Dataset({key: ("mode", np.arange(20.0, 6.0, -1)) for key in keys})
    slow["participation"] = (("mode", "state"), np.ones((14, 1)))
    slow = slow.assign_coords(state=["pitch"])
    decay = check_sections(Checked({"decay": found, "modes": slow}, {}, {}))[3]
    assert decay.tables[-1].title == "Modes that decay slowest: 12 of 14"
    assert [row[2] for row in decay.tables[-1].rows] == [f"{20 - k:.4f}" for k in range(12)]
    (only,) = decay.points
    assert only.startswith("pitch: after its release the model swings to 3 times the offset")


def test_large_loads_are_shown_alike_in_figure_and_table():
    """At full scale, as where those of a model are a million times as large."""

    def found(size):
        run = moored_run(2)
        run["mooring_bow"].values *= size
        model = SPEC.fit(run, ["mooring_bow"], ["eta"])
        return statistics(model, {"run": run})

    both = [found(size) for size in (1.0, 1e6)]
    few, many = (
        check_sections(Checked({"statistics": each}, {}, {}))[5].tables[0].rows for each in both
    )
    assert [row[0] for row in many] == ["mooring_bow [MN]"] * 2
    assert [row[1:] for row in many] == [row[1:] for row in few]
    for draw in (plot.exceedance, plot.density):
        few, many = (draw(each).axes[0] for each in both)
        assert "[MN]" in many.get_xlabel()
        assert many.get_xlim() == pytest.approx(few.get_xlim())


def test_several_probes_without_positions_are_not_compared_with_the_vessel():
    run = moored_run(2)
    run["eta_aft"] = run["eta"].shift(time=5, fill_value=0.0)
    model = SPEC.fit(run, ["heave"], ["eta", "eta_aft"])
    response = check_sections(check_model(model, {"run": run}))[1]
    assert re.search(r"Cannot be judged: .* State both in \[rig\]", " ".join(response.notices))
    assert not response.tables
    with request_error("run has no channel 'eta_aft'"):
        check_model(model, {"run": run.drop_vars("eta_aft")})


def test_what_the_model_does_not_answer_and_laws_that_do_not_hold_are_told():
    run, inputs = moored_run(2), ["eta", "mooring_bow"]
    model = SPEC.fit(run, ["heave"], inputs)
    checked = check_model(model, {"run": run})
    assert "inputs (mooring_bow) are at their means" in " ".join(check_sections(checked)[1].words)
    found = checked.results["statistics"]
    sides = ["extreme_chance", "trough_chance"]
    for side in sides:
        for chance, told in ((0.011, 0), (0.009, 1)):
            fits = found.assign(1.0 + 0 * found[sides])
            fits[side] *= chance
            shown = check_sections(Checked({"statistics": fits}, {}, {}))
            assert sum(len(each.points) for each in shown) == told
