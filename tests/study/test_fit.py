"""From a campaign's [model] table to a model, and which samples train and test."""

import dataclasses
import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import seakeep
from seakeep import BayesianHankelDMDc, Fixed, LogUniform, ProbeAlignment, Uniform
from seakeep.campaign import ModelSettings
from seakeep.campaign.store import write_prepared
from seakeep.cli import main
from seakeep.errors import RequestError, SeakeepWarning
from seakeep.models import KINDS
from seakeep.study import (
    build_spec,
    compare,
    comparison_table,
    fit_baselines,
    fit_campaign,
    training_runs,
)
from seakeep.study.resolve import resolve_model

RATE = 10.0


@pytest.fixture
def halves(tmp_path):
    """One run of 200 s: its first half trains, its second tests."""
    rng = np.random.default_rng(4)
    time = np.arange(2001) / RATE
    eta = np.sin(2 * np.pi * 0.5 * time + np.sin(time / 9)) + 0.1 * rng.standard_normal(time.size)
    heave = np.zeros(time.size)
    for k in range(2, time.size):
        heave[k] = 1.7 * heave[k - 1] - 0.8 * heave[k - 2] + 0.1 * eta[k - 1]
    table = np.column_stack([time, eta, heave])
    np.savetxt(
        tmp_path / "run.csv", table, delimiter=",", header="t [s],eta [m],z [m]", comments=""
    )
    return tmp_path


def campaign(folder: Path, model: str, runs: str | None = None) -> seakeep.Campaign:
    runs = runs or '[runs.all]\nfile = "run.csv"\ntrain = [0.0, 100.0]\ntest = [100.0, 200.0]\n'
    (folder / "campaign.toml").write_text(
        '[channels.eta_fwd]\ncolumn = "eta"\n[channels.heave]\ncolumn = "z"\n'
        f'{runs}\n[model]\nstates = ["heave"]\ninputs = ["eta_fwd"]\n{model}\n'
    )
    return seakeep.read_campaign(folder / "campaign.toml")


EXACT = "state_delays = 2\ninput_delays = 2\nridge = 1e-9"


def test_only_the_training_span_trains(halves):
    model = fit_campaign(campaign(halves, EXACT))
    assert model.training.stop == (100.0,)
    assert model.training.columns == (1001 - 1 - 2,)


def test_the_test_starts_in_the_test_span_with_history_from_before_it(halves):
    model = fit_campaign(campaign(halves, "state_delays = 2\ninput_delays = 60\nridge = 1e-9"))
    (judged,) = compare(model, campaign(halves, EXACT))
    assert judged.start == 100.0  # the 60 samples of history lie in the training half
    assert float(judged.forecast.time[-1]) == 200.0
    # The system is linear; what is left is the mean: the window's means are not those of a steady
    # state, and a model of deviations has no constant term (the ends of the window over its
    # length, some 1e-4 here).
    assert judged.anrmse < 1e-3


def test_the_history_of_a_window_may_come_from_before_the_training_span(halves):
    runs = '[runs.all]\nfile = "run.csv"\ntrain = [100.0, 150.0]\ntest = [150.0, 200.0]\n'
    given = "state_delays = 2\ninput_delays = 60\nridge = 1e-9\nwindow = 501"
    assert fit_campaign(campaign(halves, given, runs)).training.columns == (500,)
    without = given.replace("\nwindow = 501", "")
    assert fit_campaign(campaign(halves, without, runs)).training.columns == (440,)


@pytest.mark.filterwarnings("ignore:all. eta_fwd stuck")  # what its preparation finds
def test_a_dead_probe_in_a_test_run_is_told(halves):
    whole = campaign(halves, EXACT)
    model = fit_campaign(whole)
    table = np.loadtxt(halves / "run.csv", delimiter=",", skiprows=1)
    table[1001:, 1] = 0.0
    np.savetxt(halves / "run.csv", table, delimiter=",", header="t [s],eta [m],z [m]", comments="")
    with (
        pytest.warns(SeakeepWarning, match="eta_fwd stuck"),
        pytest.warns(SeakeepWarning, match="eta_fwd level drifts"),
        pytest.warns(SeakeepWarning, match=r"channel 'eta_fwd' of all is constant \(0\) over the"),
    ):
        compare(model, whole)


def test_a_run_that_only_tests_starts_when_its_history_is_full(halves):
    runs = (
        '[runs.a]\nfile = "run.csv"\nspan = [0.0, 100.0]\nrole = "train"\n'
        '[runs.b]\nfile = "run.csv"\nspan = [100.0, 200.0]\nrole = "test"\n'
    )
    whole = campaign(halves, "state_delays = 2\ninput_delays = 60\nridge = 1e-9", runs)
    (judged,) = compare(fit_campaign(whole), whole)
    assert judged.run == "b"
    assert judged.start == pytest.approx(106.0)


def test_start_and_steps_of_the_user_are_taken(halves):
    whole = campaign(halves, EXACT)
    (judged,) = compare(fit_campaign(whole), whole, ["all"], start=150.0, steps=20)
    assert judged.forecast.sizes["time"] == 20
    assert float(judged.forecast.time[0]) == pytest.approx(150.1)
    with pytest.raises(RequestError, match=r"steps must be a whole number of .* received 4\.7"):
        compare(fit_campaign(whole), whole, ["all"], start=150.0, steps=4.7)


def test_steps_one_past_the_record_are_judged_where_there_is_a_measurement(halves):
    whole = campaign(halves, EXACT)
    (judged,) = compare(fit_campaign(whole), whole, ["all"], start=199.0, steps=11)
    assert judged.forecast.sizes["time"] == 10
    assert judged.status == "ok"


def test_a_preset_counts_in_encounter_periods_and_keys_override_it():
    settings = ModelSettings(states=("heave",), inputs=("eta_fwd",), preset="paper", ridge=7.0)
    spec = build_spec(settings, encounter_period=2.0, dt=0.1)
    assert (spec.state_delays, spec.input_delays, spec.window) == (20, 100, 400)
    assert spec.ridge == 7.0
    assert spec.delay_rows == "ridge"


def test_a_window_of_a_preset_gives_way_to_all_of_the_run():
    stated = ModelSettings(states=("heave",), inputs=("eta_fwd",), window="inf T")
    found = resolve_model(stated, encounter_period=2.0, dt=0.1, preset="paper")
    assert found.spec.window is None
    assert found.sources["window"] == "stated"


def test_a_preset_without_period_says_where_to_state_it():
    settings = ModelSettings(states=("heave",), preset="recommended")
    with pytest.raises(RequestError, match=r"State encounter_period \(s\) in \[campaign\]"):
        build_spec(settings, encounter_period=None, dt=0.1)


def test_a_missing_key_is_named_with_the_preset_as_a_way_out():
    settings = ModelSettings(states=("heave",), state_delays=3)
    with pytest.raises(
        RequestError, match=r"no input_delays\. Add input_delays, ridge, or a preset"
    ):
        build_spec(settings, encounter_period=1.0, dt=0.1)


ENSEMBLE = """
kind = "bayesian_hankel_dmdc"
n_members = 4
seed = 7
"""


def table(**keys):
    channels = {"states": ("heave",), "inputs": ("eta_fwd",)}
    return ModelSettings.model_validate({**channels, "kind": "bayesian_hankel_dmdc", **keys})


def test_one_function_makes_the_spec_of_an_ensemble_too():
    stated = table(
        window={"fixed": "12 T"},
        state_delays="0.5 T",
        input_delays={"uniform": ["1 T", "2 T"]},
        ridge={"log_uniform": [0.1, 10]},
        n_members=9,
        seed=3,
        sampling="sobol",
        train_on="windows",
        delay_rows="exact",
        alignment={"surge": "none"},
    )
    assert build_spec(stated, encounter_period=2.0, dt=0.1) == BayesianHankelDMDc(
        encounter_period=2.0,
        dt=0.1,
        window=Fixed("12 T"),
        state_delays=10,
        input_delays=Uniform("1 T", "2 T"),
        ridge=LogUniform(0.1, 10),
        n_members=9,
        seed=3,
        sampling="sobol",
        train_on="windows",
        delay_rows="exact",
        alignment=seakeep.ProbeAlignment(surge="none"),
    )


def test_a_preset_of_an_ensemble_is_overridden_key_by_key():
    stated = table(preset="paper", n_members=5, ridge=80.0, train_on="runs")
    expected = dataclasses.replace(
        BayesianHankelDMDc.paper(encounter_period=2.0, dt=0.1, n_members=5),
        ridge=80.0,
        train_on="runs",
    )
    assert build_spec(stated, encounter_period=2.0, dt=0.1) == expected


def test_distributions_of_scipy_are_named_in_the_table():
    stated = {
        "distribution": "truncnorm",
        "parameters": {"a": -2, "b": 2, "loc": 1, "scale": 0.1},
        "unit": "T",
    }
    spec = build_spec(table(preset="paper", state_delays=stated), encounter_period=2.0, dt=0.1)
    expected = stats.truncnorm(-2, 2, loc=1, scale=0.1).ppf([0.0, 0.3, 1.0])
    np.testing.assert_array_equal([spec.state_delays.ppf(q) for q in (0.0, 0.3, 1.0)], expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{ uniform = [30, 10] }", "state_delays: Uniform needs its lower bound below the upper"),
        ("{ uniform = [1, inf] }", "Uniform needs finite numbers; received 1 and inf"),
        ('{ uniform = ["1 T", 3] }', "Uniform needs one unit"),
        ("{ log_uniform = [0, 1] }", "LogUniform needs a positive lower bound"),
        ("{ uniform = [1, 2], fixed = 1 }", "state_delays: a prior is one of { uniform"),
        ('{ distribution = "nrom" }', "scipy.stats has no distribution 'nrom'.*mean 'norm'"),
        (
            '{ distribution = "gamma", parameters = { scale = 2.0 } }',
            "'parameters' of 'gamma' are a, loc, scale, of which loc and scale may be left out; ",
        ),
        (
            '{ distribution = "norm", parameters = { scale = -1.0 } }',
            "'norm' with these 'parameters' has no median; correct them",
        ),
        ("-1", "state_delays must be an integer of at least 0; received -1"),
        ('"1 /T"', "state_delays must be a length that is not negative, .* received '1 /T'"),
        ('"-1 T"', "state_delays must be a length that is not negative, .* received '-1 T'"),
        ("1\nridge = '1 T'", "ridge must be a number, zero or positive, or the word rollout"),
        ('"1 Q"', "state_delays: a text in place of a number counts in encounter periods"),
        ("1\nriddge = 2", "has no key 'riddge'. Did you mean 'ridge'"),
        (
            "1\nalignment = { mode = 'dispersive' }",
            "alignment: mode must be 'effective'",
        ),
        ("1\nalignment = { mode = 'dispersion', celerity = 2.0 }", "celerity.*effective"),
        ("1\nalignment = { sruge = 'none' }", "alignment: unknown key 'sruge'.*mean 'surge'"),
        ("1\nselect = { fold = 'run' }", "select: unknown key 'fold'.*mean 'folds'"),
    ],
)
def test_wrong_keys_of_a_model_are_named_before_its_runs_are_prepared(halves, text, message):
    wrong = campaign(halves, f'{ENSEMBLE}\npreset = "paper"\nstate_delays = {text}')
    with pytest.raises(RequestError, match=rf"line \d+, model: .*{message}"):
        fit_campaign(wrong)


def test_keys_of_an_ensemble_in_a_single_model_are_named(halves):
    with pytest.raises(RequestError, match="kind = 'hankel_dmdc' has no key 'train_on'"):
        fit_campaign(campaign(halves, EXACT + '\ntrain_on = "runs"'))


def test_an_ensemble_without_period_or_priors_says_where_to_state_them():
    with pytest.raises(RequestError, match=r"an ensemble counts in .* State encounter_period"):
        build_spec(table(state_delays=1, input_delays=1, ridge=1), encounter_period=None, dt=0.1)
    with pytest.raises(
        RequestError,
        match=r"no input_delays\. Add input_delays, ridge as priors, such as { uniform",
    ):
        build_spec(table(state_delays=1), encounter_period=2.0, dt=0.1)


WINDOWED = (
    ENSEMBLE + "state_delays = '0.2 T'\ninput_delays = { uniform = ['1 T', '3 T'] }\nridge = 1e-9"
)
LATE = '[runs.all]\nfile = "run.csv"\ntrain = [100.0, 150.0]\ntest = [150.0, 200.0]\n'


@pytest.mark.parametrize("train_on", ["all", "runs", "windows"])
def test_an_ensemble_learns_inside_the_training_span(halves, train_on):
    model = f"{WINDOWED}\nwindow = {{ uniform = ['4 T', '8 T'] }}\ntrain_on = '{train_on}'"
    ensemble = fit_campaign(campaign(halves, model, LATE))
    assert ensemble.n_members == 4
    first, stop = ensemble.training_spans["all"]
    longest = 0.1 * (int(ensemble.draws.window_samples.max()) - 1)
    assert first >= 100.0
    assert stop <= 150.0 + 1e-9
    if train_on == "windows":
        assert len(set(ensemble.draws.last_sample.values)) > 1
    else:
        assert (first, stop) == (pytest.approx(150.0 - longest), pytest.approx(150.0))


def test_the_history_of_an_ensemble_may_come_from_before_the_span(halves):
    # The span holds 501 samples: beside a window of 495 there is no room for the delays.
    snapshots = 495
    model = f"{WINDOWED}\nwindow = {snapshots}"
    ensemble = fit_campaign(campaign(halves, model, LATE))
    assert set(ensemble.draws.window_samples.values) == {snapshots}
    assert ensemble.draws.attrs["redrawn"] == 0
    for number in range(4):
        assert ensemble.member(number).training.columns == (snapshots - 1,)


def test_the_same_table_gives_the_members_that_python_gives(halves):
    model = f"{WINDOWED}\nwindow = {{ uniform = ['10 T', '20 T'] }}"
    whole = campaign(halves, model)
    ensemble = fit_campaign(whole)
    spec = BayesianHankelDMDc(
        encounter_period=whole.encounter_period(),
        window=Uniform("10 T", "20 T"),
        state_delays="0.2 T",
        input_delays=Uniform("1 T", "3 T"),
        ridge=1e-9,
        n_members=4,
        seed=7,
    )
    run = whole.prepare()["all"].sel(time=slice(None, 100.0 + 1e-6))
    expected = spec.fit({"all": run}, ["heave"], ["eta_fwd"])
    assert expected.members == ensemble.members
    np.testing.assert_array_equal(ensemble.member(2).A, expected.member(2).A)


def test_repeats_of_an_ensemble_are_warned_of(repeating):
    delays = "state_delays = '0.2 T'\ninput_delays = '0.2 T'\n"
    whole = campaign(repeating, f"{ENSEMBLE}{delays}ridge = 1")
    with pytest.warns(seakeep.SeakeepWarning, match=REPEATS):
        fit_campaign(whole)


def test_a_campaign_without_training_run_is_refused(halves):
    whole = campaign(halves, EXACT, '[runs.b]\nfile = "run.csv"\nrole = "test"\n')
    with pytest.raises(RequestError, match="no run of the campaign trains a model"):
        training_runs(whole.prepare())


def test_a_campaign_without_test_run_is_told_to_name_one(halves):
    whole = campaign(halves, EXACT, '[runs.a]\nfile = "run.csv"\nrole = "train"\n')
    with pytest.raises(RequestError, match="no run of the campaign tests a model"):
        compare(fit_campaign(whole), whole)


@pytest.fixture
def repeating(tmp_path):
    """A sea of equally spaced components that comes back, turned, after 100 s of 200."""
    rng = np.random.default_rng(4)
    time = np.arange(2001) / RATE
    frequency, phase = 0.303 + 0.01 * np.arange(40), rng.uniform(0, 2 * np.pi, 40)
    eta = np.cos(2 * np.pi * np.outer(time, frequency) + phase).sum(axis=1)
    surge = 0.5 * np.sin(time / 5) + 0.01 * rng.standard_normal(time.size)
    table = np.column_stack([time, eta, np.roll(eta, 5), surge])
    header = "t [s],eta [m],z [m],x [m]"
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header=header, comments="")
    return tmp_path


REPEATS = (
    r"the input 'eta_fwd' of all repeats training input: .* % of it, such as from t = .* s on, is "
    r"what all holds from t = .* turned by .* memory, not skill: test on another run"
)


def test_a_test_that_repeats_its_training_is_warned_of(repeating):
    whole = campaign(repeating, EXACT)
    with pytest.warns(seakeep.SeakeepWarning, match=REPEATS):
        model = fit_campaign(whole)
    with pytest.warns(seakeep.SeakeepWarning, match=REPEATS):
        compare(model, whole)


def test_what_another_run_trained_on_is_looked_at_too(repeating):
    runs = (
        '[runs.all]\nfile = "run.csv"\nspan = [100.0, 200.0]\nrole = "test"\n'
        '[runs.first]\nfile = "run.csv"\nspan = [0.0, 100.0]\nrole = "train"\n'
    )
    whole = campaign(repeating, EXACT, runs)
    model = fit_campaign(whole)
    with pytest.warns(seakeep.SeakeepWarning, match="is what first holds from"):
        compare(model, whole)


def test_regular_waves_are_not_warned_of(repeating):
    runs = '[runs.all]\nfile = "run.csv"\nwaves = "regular"\ntrain = [0, 100]\ntest = [100, 200]\n'
    whole = campaign(repeating, EXACT, runs)
    compare(fit_campaign(whole), whole)  # warnings are errors


def test_a_model_table_aligns_and_its_table_says_on_what_it_is_conditional(halves):
    path = halves / "run.csv"
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    surge = 0.3 * np.sin(table[:, 0] / 5)
    header = "t [s],eta [m],z [m],x [m]"
    np.savetxt(path, np.column_stack([table, surge]), delimiter=",", header=header, comments="")
    # A probe downstream: its waves are carried upstream, to where they were before.
    aligned = EXACT + '\nalignment = { mode = "dispersion", surge = "measured", offset = -0.3 }'
    text = campaign(halves, aligned).path.read_text()
    (halves / "campaign.toml").write_text(
        '[rig]\nwater_depth = 3.6\npositions = { eta_fwd = 1.0 }\n[channels.surge]\ncolumn = "x"\n'
        + text.replace("test = [100.0, 200.0]", "test = [100.0, 200.0]\nprobe_offset = 0.1")
    )
    whole = seakeep.read_campaign(halves / "campaign.toml")
    with pytest.warns(SeakeepWarning, match=r"up to 1\.14 s after the instant"):
        model = fit_campaign(whole)
    expected = seakeep.ProbeAlignment(mode="dispersion", surge="measured", offset=-0.3)
    assert model.alignment.settings == expected
    with pytest.warns(SeakeepWarning, match="needs these waves ahead of time"):
        found = comparison_table(compare(model, whole)).isel(run=0)
    assert str(found["conditional_on"].values) == "surge"
    assert float(found["probe_offset"]) == 0.1


def test_a_preset_fills_in_what_is_not_stated_key_by_key_and_says_so():
    stated = {"state_delays": 4, "input_delays": 20, "ridge": 0.15, "alignment": {"surge": "none"}}
    settings = ModelSettings(states=("heave",), inputs=("eta_fwd",), **stated)
    found = resolve_model(settings, 2.0, 0.1, preset="recommended")
    assert (found.spec.ridge_scale, found.spec.delay_rows) == ("per_snapshot", "exact")
    assert (found.spec.state_delays, found.spec.ridge) == (4, 0.15)
    kept = json.loads(json.dumps(found.to_json()))
    assert (kept["kind"], kept["preset"], kept["ensemble"]) == (
        "hankel_dmdc",
        "recommended",
        False,
    )
    sources = {key: each["source"] for key, each in kept["settings"].items()}
    assert kept["settings"]["ridge_scale"] == {"value": "per_snapshot", "source": "preset"}
    assert kept["settings"]["alignment.surge"] == {"value": "none", "source": "stated"}
    assert sources["alignment.mode"] == sources["select.observables"] == "preset"
    assert sources["rank"] == sources["stable"] == "default"
    assert sources["ridge"] == "stated"


@pytest.mark.parametrize(
    ("horizon", "found"), [("15 T", (15.0,)), (["5 T", 10], (5.0, 10.0)), (7.5, (7.5,))]
)
def test_the_horizon_of_free_runs_is_stated_in_encounter_periods(horizon, found):
    table = {"states": ("heave",), "inputs": ("eta_fwd",), "select": {"horizon": horizon}}
    settings = ModelSettings.model_validate(table)
    assert resolve_model(settings, 2.0, 0.1, preset="recommended").spec.select.horizon == found


def test_a_study_that_leaves_sea_states_out_chooses_so_too():
    settings = ModelSettings(states=("heave",), inputs=("eta_fwd",))
    found = resolve_model(settings, 2.0, 0.1, preset="recommended", folds="sea_state")
    assert (found.spec.select.folds, found.sources["select.folds"]) == ("sea_state", "study")
    assert found.spec.select.observables
    stated = ModelSettings(states=("heave",), inputs=("eta_fwd",), select={"folds": "run"})
    found = resolve_model(stated, 2.0, 0.1, preset="recommended", folds="sea_state")
    assert (found.spec.select.folds, found.sources["select.folds"]) == ("run", "stated")
    numbers = ModelSettings(states=("heave",), inputs=("eta_fwd",), kind="mean")
    assert not hasattr(resolve_model(numbers, 2.0, 0.1, folds="sea_state").spec, "select")


def test_the_paper_s_alignment_is_taken_where_the_campaign_can_align():
    settings = ModelSettings(states=("heave",), inputs=("eta_fwd",), preset="paper")
    assert resolve_model(settings, 2.0, 0.1).spec.alignment is None
    found = resolve_model(settings, 2.0, 0.1, aligned=True)
    assert found.spec.alignment == ProbeAlignment(mode="effective", surge="measured")
    assert found.sources["alignment.mode"] == "preset"
    stated = ModelSettings(
        states=("heave",), inputs=("eta_fwd",), preset="paper", alignment={"surge": "none"}
    )
    assert resolve_model(stated, 2.0, 0.1, aligned=True).spec.alignment.surge == "none"
    baseline = ModelSettings(states=("heave",), inputs=("eta_fwd",), kind="fir")
    found = resolve_model(baseline, 2.0, 0.1, preset="paper", aligned=True)
    assert (found.preset, found.spec.alignment.surge) == ("recommended", "measured")
    still = ModelSettings(states=("heave",), kind="mean")
    found = resolve_model(still, 2.0, 0.1, preset="paper", aligned=True)
    assert found.spec.to_json() == {"window": None}


def test_priors_and_seed_of_a_study_are_kept_as_json_values_with_their_source():
    found = resolve_model(
        table(ridge={"log_uniform": [0.1, 10]}), 2.0, 0.1, preset="paper", seed=7
    ).to_json()
    assert found["n_members"] == 100
    settings = found["settings"]
    assert settings["ridge"] == {
        "value": {"log_uniform": [0.1, 10.0]},
        "source": "stated",
    }
    assert settings["window"] == {
        "value": {"uniform": ["10 T", "30 T"]},
        "source": "preset",
    }
    assert settings["seed"] == {"value": 7, "source": "study"}


@pytest.mark.parametrize("kind", ["hankel_dmdc", "bayesian_hankel_dmdc"])
def test_read_outs_are_kept_as_json_values_with_their_source(kind):
    read = {"heave": {"of": ["pitch"], "kind": "stacked"}}
    stated = ModelSettings(states=("heave", "pitch"), kind=kind, readouts=read)
    told = resolve_model(stated, 2.0, 0.1, preset="recommended").to_json()["settings"]
    expected = [{"channel": "heave", "of": ["pitch"], "kind": "stacked"}]
    assert told["readouts"] == {"value": expected, "source": "stated"}
    with pytest.raises(RequestError, match="received delay_rows = 'ridge', rank = None"):
        resolve_model(stated, 2.0, 0.1, preset="paper")
    read_by_fir = ModelSettings(states=("heave", "pitch"), kind="fir", readouts="auto")
    with pytest.raises(RequestError, match="kind = 'fir' has no key 'readouts'"):
        resolve_model(read_by_fir, 2.0, 0.1)


def test_an_unknown_kind_or_key_is_named():
    with pytest.raises(RequestError, match=r"no kind of model 'hankel'.*Kinds: hankel_dmdc"):
        build_spec(ModelSettings(states=("heave",), kind="hankel"), 2.0, 0.1)
    with pytest.raises(RequestError, match=r"has no key 'riddge'.*mean 'ridge'"):
        build_spec(ModelSettings(states=("heave",), preset="paper", riddge=1.0), 2.0, 0.1)


def sines(folder: Path, periods: dict[str, tuple[float, ...]]) -> str:
    """Runs of regular waves, one file each; the last one tests."""
    time = np.arange(1501) / RATE
    text = ""
    for number, (name, each) in enumerate(periods.items()):
        eta = sum(np.sin(2 * np.pi * time / period) for period in each)
        table = np.column_stack([time, eta, 0.5 * np.roll(eta, 2)])
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="t [s],eta [m],z [m]",
                   comments="")  # fmt: skip
        role = "test" if number == len(periods) - 1 else "train"
        text += f'[runs.{name}]\nfile = "{name}.csv"\nrole = "{role}"\n'
    return text


@pytest.mark.parametrize(
    ("period", "words"),
    [
        # The middles of the bands, a sixth of an octave wide, that hold 0.5 s, 1 s and 4 s.
        (2.0, r"between the periods that trained the model \(1\.06 and 3\.78 s, with none bet"),
        (8.0, r"outside the periods that trained the model \(0\.472 to 4\.24 s\)"),
    ],
)
def test_waves_of_periods_that_were_not_trained_are_warned_of(tmp_path, period, words):
    runs = sines(tmp_path, {"shorter": (0.5,), "short": (1.0,), "long": (4.0,), "new": (period,)})
    asked = campaign(tmp_path, EXACT, runs)
    model = fit_campaign(asked)
    with pytest.warns(SeakeepWarning, match=rf"new: eta_fwd: .* lies {words}.*Train in such"):
        compare(model, asked)
    write_prepared(asked)
    with pytest.warns(SeakeepWarning, match=rf"new: eta_fwd: .* lies {words}"):
        fit_campaign(asked)


def test_a_setting_has_one_score_whether_fit_or_tune_chose_it(halves, capsys):
    lengths = 'state_delays = "1 T"\ninput_delays = "1 T"\nridge = "rollout"\ndelay_rows = "exact"'
    asked = campaign(halves, f"{lengths}\n[campaign]\nencounter_period = 2.5")  # 2 s is measured
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SeakeepWarning)
        chosen = fit_campaign(asked)
        assert main(["tune", str(asked.path), "--vary", "ridge"]) == 0
    assert capsys.readouterr().out.startswith(chosen.selection)


def test_a_baseline_that_is_left_out_names_what_to_write(halves):
    asked = campaign(halves, EXACT + "\n[campaign]\nencounter_period = 0.8")
    with pytest.warns(SeakeepWarning, match=r"'subspace' is left out: .*the key order, or raise.*"
                      r"\[models\.subspace\], fit it with --model subspace"):  # fmt: skip
        fit_baselines(asked, ["heave"], ["eta_fwd"])
    own = '\n[models.subspace]\nkind = "subspace"\norder = 2\nfuture = 4\nstate_delays = 4\n'
    own += 'input_delays = 4\nstates = ["heave"]\ninputs = ["eta_fwd"]\n'
    assert fit_campaign(campaign(halves, EXACT + own), "subspace").kind == "subspace"


def test_waves_of_trained_periods_are_not_warned_of(tmp_path, recwarn):
    asked = campaign(tmp_path, EXACT, sines(tmp_path, {"a": (1.0, 4.0), "new": (4.0,)}))
    compare(fit_campaign(asked), asked)
    assert not [each for each in recwarn if "periods" in str(each.message)]


def test_a_lead_reads_waves_ahead_of_time(halves):
    asked = campaign(halves, f"{EXACT}\nlead = 8")
    with pytest.warns(SeakeepWarning, match=r"read the waves up to 0\.7 s after the instant that"):
        model = fit_campaign(asked)
    with pytest.warns(SeakeepWarning, match=r"of all reads the waves up to 0\.7 s after"):
        compare(model, asked, steps=20)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SeakeepWarning)
        (whole,) = compare(model, asked)
    # The step to instant k reads the waves of k + 7: seven instants before the end it is the last.
    run = asked.prepare()[whole.run]
    assert float(whole.forecast["time"][-1]) == pytest.approx(float(run["time"][-8]))


def test_a_field_of_a_spec_is_a_key_of_files(monkeypatch, halves, tmp_path):
    @dataclasses.dataclass(frozen=True)
    class Damped(seakeep.HankelDMDc):
        kind = "damped"
        damping: float = 0.5

    monkeypatch.setitem(KINDS, "damped", Damped)
    text = f'kind = "damped"\ndamping = 0.7\n{EXACT}'
    model = fit_campaign(campaign(halves, text))
    assert model.settings.damping == 0.7
    assert Damped.from_json(json.loads(json.dumps(model.settings.to_json()))) == model.settings
    wrong = campaign(halves, text.replace("damping", "dampign"))
    with pytest.raises(RequestError, match=r"no key 'dampign'.*mean 'damping'"):
        fit_campaign(wrong)
