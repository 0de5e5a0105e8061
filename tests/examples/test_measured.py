"""The examples on measured data hold what their pages say (needs SEAKEEP_DATA_DIR)."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from near import assert_near
from places import ROOT
from tutorial_study import edit

import seakeep
from seakeep.campaign import load_prepared, write_prepared
from seakeep.campaign.datasets import data_folder, find_dataset, state_of
from seakeep.study import compare, comparison_table, fit_campaign

pytestmark = [
    pytest.mark.data,
    # Models that look ahead say so, of other wave periods too: the pages say it of these.
    pytest.mark.filterwarnings("ignore::seakeep.errors.SeakeepWarning"),
]

EXAMPLES = ROOT / "examples"
SPAN = (0.0, 3065.0)  # s, the first 30 % of Data02


@pytest.fixture(scope="module")
def section(tmp_path_factory):
    """The campaign, with the observables that its search of some minutes takes for each model.

    Its runs are prepared where the commands look for them.
    """
    path = tmp_path_factory.mktemp("section") / "campaign.toml"
    shutil.copy(EXAMPLES / "ntnu_ship_section" / "campaign.toml", path)
    powers = 'observables = [{ kind = "powers", of = ["eta_wp1", "eta_wp2", "eta_wp4"] }]'
    tensions = ("[models.tensions]", f"[models.tensions]\n{powers}")
    edit(path, ("observables = true", "observables = false"), tensions)
    campaign = seakeep.read_campaign(path)
    write_prepared(campaign)
    return campaign


@pytest.fixture(scope="module")
def section_runs(section):
    return load_prepared(section)


@pytest.mark.parametrize("name", ["ntnu_ship_section", "sjtu_semisub"])
def test_the_files_are_the_published_ones(name):
    assert state_of(find_dataset(name), data_folder()) == "complete"


def test_motions_of_unseen_runs_are_forecast_to_the_end_of_the_record(section, section_runs):
    model = fit_campaign(section)
    assert len(model.training.runs) == 10
    assert model.input_delays * model.dt >= 2.4
    assert model.spectral_radius < 1
    judged = compare(model, section)
    assert [each.run for each in judged] == ["3041_2", "3061_2", "3102_3"]
    for each in judged:
        # The last step reads the waves `lead_samples` after the instant that it starts from.
        end = float(section_runs[each.run]["time"][-max(model.lead_samples, 1)])
        assert each.forecast["time"][-1] == end
        assert 20 < each.start < 30  # s; before, no wave has come to the section
    table = comparison_table(judged)
    # Asked for: 0.05 in the mean. Found: 0.041, and at most 0.069; a quarter as much again leaves
    # room for other libraries' rounding and none for a wrong sign or lag.
    assert table["nrmse"].mean() <= 0.05
    assert table["nrmse"].max() <= 0.09


def test_sway_needs_the_tilt_and_the_arm_with_their_signs(section_runs):
    for name in ("3102_1", "3102_2", "3102_3", "3102_4"):
        run = section_runs[name]
        springs = run["spring_offset_in_band"].std()
        assert 0.8 <= float(run["sway"].std() / springs) <= 1.2
        wrong = run["acc_sway"] + 9.81 * run["roll"] - 0.0502 * run["roll_acceleration"]
        integrated = seakeep.signals.integrate(wrong, run.attrs["dt"], (0.4, 5.0), times=2)
        assert integrated.std() / springs > 2.0


def test_sway_is_forecast_where_its_target_is_sound(section):
    table = comparison_table(compare(fit_campaign(section, "sway"), section))
    # Asked for: 0.17 for 3102_3 (found 0.044). The other two stand near the resonance of roll,
    # where the tilt's part is ten times the sway; they are reported, not judged.
    assert table["nrmse"].sel(run="3102_3", channel="sway") <= 0.08
    assert np.all(np.isfinite(table["nrmse"]))


def test_tensions_are_forecast_in_a_sea_that_was_trained(section):
    recommended, paper = (
        comparison_table(compare(fit_campaign(section, name), section, start=8.0))
        for name in ("tensions", "tensions_paper")
    )
    # Asked for from still water on: 0.25 (found 0.21, and 0.26 from where the waves have come)
    # where training holds the sea; in the others drift stays poor.
    assert recommended["anrmse"].sel(run="3102_3") <= 0.25
    assert recommended["anrmse"].mean() < 0.75 * paper["anrmse"].mean()


@pytest.fixture(scope="module")
def semisubmersible():
    campaign = seakeep.read_campaign(EXAMPLES / "sjtu_semisub" / "campaign.toml")
    return campaign, fit_campaign(campaign), campaign.prepare(["Data01", "Data02"])


def test_semisubmersible_heave_runs_freely_over_the_last_30_percent(semisubmersible):
    campaign, model, _ = semisubmersible
    (judged,) = compare(model, campaign, ["Data01"])
    # The forecast ends where the waves do that the model looks ahead to, 10 s before the record.
    assert_near(model.training.stop[0] / float(judged.forecast["time"][-1] + 10.1), 0.7, 0.001)
    assert judged.anrmse <= 0.28  # 0.253; coherence allows a linear model about 0.31


def test_the_offset_of_a_probe_that_stood_elsewhere_is_estimated(semisubmersible):
    campaign, model, runs = semisubmersible
    run = runs["Data02"]
    (judged,) = compare(model, campaign, ["Data02"])
    found = seakeep.estimate_probe_offset(model, run, SPAN)
    # The authors' phase differences between the records read as 30 to 40 m in deep water.
    assert 30 < found.offset < 45
    assert_near(found.offset, run.attrs["probe_offset"], 0.05)
    assert 0.5 < found.spread < 3
    assert_near(SPAN[1] / float(run["time"][-1]), 0.3, 1e-3)
    assert judged.start == pytest.approx(run.attrs["test_span"][0])
    uncorrected = model.forecast(run.assign_attrs(probe_offset=0.0), start=judged.start)
    wrong = float(seakeep.metrics.anrmse(predicted=uncorrected, measured=judged.measured))
    # Asked for: at most 0.6 of the uncorrected. Found: 0.291 of 0.596, that is 0.49.
    assert wrong > 0.5
    assert judged.anrmse <= 0.6 * wrong


def test_a_constant_time_lag_stands_beside_the_offset(semisubmersible):
    _, model, runs = semisubmersible
    train, run = runs.values()
    train = train.sel(time=slice(*train.attrs["train_span"]))
    # One celerity makes of a distance one lag for all frequencies; which one does not matter.
    celerity = 25.0
    one = seakeep.ProbeAlignment(mode="effective", surge="none", celerity=celerity)
    lagging = replace(model.settings, alignment=one).fit(train, model.states, model.inputs)
    found = seakeep.estimate_probe_offset(lagging, run, SPAN)
    assert_near(found.offset / celerity, 1.31, 0.10)  # s; twice its spread of 0.05
    assert 0.02 < found.spread / celerity < 0.12
    start = run.attrs["test_span"][0]
    forecast = lagging.forecast(run.assign_attrs(probe_offset=found.offset), start=start)
    measured = run.sel(time=forecast["time"])
    lagged = float(seakeep.metrics.nrmse(predicted=forecast, measured=measured)["heave"])
    # It does almost as well as dispersion here (0.310 against 0.291): the sea is narrow.
    assert_near(lagged, 0.310, 0.01)
