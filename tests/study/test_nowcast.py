"""Skill against lead time of a study's models in service."""

import numpy as np
import pytest
import xarray as xr
from tutorial_study import put_tutorial

from seakeep.study import read_study, run_study
from seakeep.study.nowcast import nowcast
from seakeep.study.plan import make_plan
from seakeep.study.units import fit_training

STUDY = """
[study]
campaign = "campaign.toml"
states = ["heave"]
inputs = ["eta_fwd", "eta_mid"]
[training]
windows = 1
[models.single]
[tests.unseen]
runs = ["unseen"]
windows = 1
[statistics]
n_series = 2
[output]
nowcast = true
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("nowcast")
    put_tutorial(folder, STUDY)
    return read_study(folder / "study.toml")


@pytest.fixture(scope="module")
def result(study, tmp_path_factory):
    return run_study(study, tmp_path_factory.mktemp("results"))


def test_a_study_judges_its_models_in_service(study, result):
    found = result.groups["nowcast/single"].sel(run="unseen")
    plan, runs = make_plan(study)
    model = fit_training(plan, runs, "single", plan.training[0])
    expected = nowcast(model, runs["unseen"], found.sizes["lead"])
    for name, values in expected.data_vars.items():
        np.testing.assert_array_equal(found[name], values)
    assert found["lead"][-1] == pytest.approx(5 * plan.encounter_period, abs=plan.dt)


def test_the_report_shows_it(result):
    pytest.importorskip("matplotlib")
    from seakeep.report.comparison import nowcast_blocks
    from seakeep.report.sections.errors import service

    section = service(result)
    assert [each.name for each in section.figures] == ["nowcast_unseen"]
    assert len(section.figures[0].draw().axes) == 1
    assert section.tables[0].title == "unseen: single in service"
    found = result.groups["nowcast/single"]
    longest = float(found["lead"][-1])
    for lead_time, words in ((0.5 * longest, ""), (longest, "at least ")):
        told = found.assign(lead_time=xr.full_like(found["lead_time"], lead_time))
        (table,) = nowcast_blocks({"single": told})
        assert [row[1].startswith(words) and float(row[1][len(words) :]) for row in table.rows] == (
            pytest.approx([lead_time] * len(table.rows), rel=1e-3)  # as many digits are printed
        )
