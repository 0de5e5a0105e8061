"""From a campaign's [model] table to a model, and which samples train and test."""

import dataclasses
import json
from math import tau

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from numpy.random import default_rng
from oscillators import arx_run
from said import data_error, request_error, warned
from scipy import signal
from seas import sea
from small_tank import campaign_of, write_csv
from tutorial_study import edit

import seakeep
from seakeep import SeakeepWarning
from seakeep.campaign import write_prepared
from seakeep.models import KINDS
from seakeep.study import compare, comparison_table, fit_campaign
from seakeep.study.comparison import calibration_parts
from seakeep.study.fit import find_repeat

pytestmark = pytest.mark.filterwarnings("ignore:.*shows waves of")  # of unit size

TIME = np.arange(2001) / 10.0


def written(folder, name, eta, heave, role="train"):
    """Write a run from the start of `TIME` on; what a campaign file says of it."""
    columns = {"t [s]": TIME[: len(eta)], "eta [m]": eta, "z [m]": heave}
    path = write_csv(folder / f"{name}.csv", columns)
    return f'[runs.{name}]\nfile = "{path.name}"\nrole = "{role}"\n'


@pytest.fixture
def halves(tmp_path):
    """One run of 200 s: its first half trains, its second tests."""
    noise = 0.1 * default_rng(4).standard_normal(TIME.size)
    eta = np.sin(tau * 0.5 * TIME + np.sin(TIME / 9)) + noise
    written(tmp_path, "run", eta, signal.lfilter([0.0, 0.1], [1.0, -1.7, 0.8], eta))
    return tmp_path


def campaign(folder, model, runs=None):
    runs = runs or '[runs.all]\nfile = "run.csv"\ntrain = [0.0, 100.0]\ntest = [100.0, 200.0]\n'
    return campaign_of(
        folder,
        '[channels.eta_fwd]\ncolumn = "eta"\n[channels.heave]\ncolumn = "z"\n'
        f'{runs}\n[model]\nstates = ["heave"]\ninputs = ["eta_fwd"]\n{model}\n',
    )


EXACT = "state_delays = 2\ninput_delays = 2\nridge = 1e-9"


def test_the_test_starts_in_the_test_span_with_history_from_before_it(halves):
    model = fit_campaign(campaign(halves, "state_delays = 2\ninput_delays = 60\nridge = 1e-9"))
    assert model.training.stop == (100.0,)
    assert model.training.columns == (1001 - 1 - 60,)
    (judged,) = compare(model, campaign(halves, EXACT))
    assert judged.start == 100.0  # the 60 samples of history lie in the training half
    assert judged.forecast.time[-1] == 200.0
    # The system is linear; what is left is the mean: the window's means are not those of a steady
    # state, and a model of deviations has no constant term (the ends of the window over its
    # length, some 1e-4 here).
    assert judged.anrmse < 1e-3


def test_runs_that_train_and_test_apart(halves):
    train = '[runs.a]\nfile = "run.csv"\nspan = [0.0, 100.0]\nrole = "train"\n'
    test = '[runs.b]\nfile = "run.csv"\nspan = [100.0, 200.0]\nrole = "test"\n'
    whole = campaign(halves, "state_delays = 2\ninput_delays = 60\nridge = 1e-9", train + test)
    (judged,) = compare(fit_campaign(whole), whole)
    assert judged.run == "b"
    assert judged.start == pytest.approx(106.0)  # its history is full
    with request_error("no run of the campaign trains a model"):
        fit_campaign(campaign(halves, EXACT, test))
    alone = campaign(halves, EXACT, train)
    with request_error("no run of the campaign tests a model"):
        compare(fit_campaign(alone), alone)


def test_a_start_with_a_plus_counts_from_the_start_of_each_run(halves):
    train = '[runs.a]\nfile = "run.csv"\nspan = [0.0, 100.0]\nrole = "train"\n'
    tests = (
        f'[runs.{n}]\nfile = "run.csv"\nspan = [{s}, {s + 50.0}]\nrole = "test"\n'
        for n, s in (("b", 100.0), ("c", 150.0))
    )
    whole = campaign(halves, EXACT, train + "".join(tests))
    model = fit_campaign(whole)
    assert [each.start for each in compare(model, whole, start="+20")] == [120.0, 170.0]
    parts = calibration_parts(whole, whole.prepare(names=["b", "c"]), model.dt, "+20", "+25")
    times = [part["time"].values[[0, -1]].tolist() for part in parts.values()]
    assert times == [[120.0, 125.0], [170.0, 175.0]]


def test_a_gap_in_the_last_test_stops_before_the_first_is_forecast(halves):
    table = pd.read_csv(halves / "run.csv")
    table.loc[1500:1540, "eta [m]"] = np.nan
    table.to_csv(halves / "gap.csv", index=False)
    train = '[runs.a]\nfile = "run.csv"\nspan = [0.0, 100.0]\nrole = "train"\n'
    test = '[runs.{0}]\nfile = "{0}.csv"\nspan = [100.0, 200.0]\nrole = "test"\n'
    runs = train + test.format("run") + test.format("gap") + "\n[preparation]\ngaps = 'mask'\n"
    whole = campaign(halves, EXACT, runs)
    model = fit_campaign(whole)
    object.__setattr__(model, "forecast", None)
    with (
        warned("eta_fwd missing"),
        data_error("'eta_fwd' of gap has 41 missing"),
    ):
        compare(model, whole)


def test_a_state_that_was_not_measured_is_named(halves):
    table = pd.read_csv(halves / "run.csv")
    model = fit_campaign(campaign(halves, EXACT))
    table.loc[1500:1540, "z [m]"] = np.nan
    table.to_csv(halves / "run.csv", index=False)
    masked = "\n[preparation]\ngaps = 'mask'\n"
    message = r"all: heave was not measured at 41 of 1000 instants"
    gap = warned("heave missing: 41 samples")
    with gap, warned(message):
        (judged,) = compare(model, campaign(halves, EXACT + masked))
    assert np.isnan(judged.anrmse)


def test_a_model_of_other_channels_and_one_that_nothing_drives_are_said(halves):
    whole = campaign(halves, EXACT)
    model = fit_campaign(whole)
    other = seakeep.read_campaign(edit(whole.path, ("eta_fwd", "eta_1")))
    with request_error(r"no channel 'eta_fwd'\. Did you mean 'eta_1'"):
        compare(model, other)
    undriven = edit(whole.path, ('inputs = ["eta_1"]', "inputs = []"))
    with warned("the model has no inputs: .* no waves drive"):
        fit_campaign(seakeep.read_campaign(undriven))


@pytest.mark.filterwarnings("ignore:.*is noise")
@pytest.mark.parametrize(
    ("stated", "taken"), [("", "fir"), ('kind = "hankel_dmdc"\n', "hankel_dmdc")]
)
def test_a_filter_that_errs_less_is_taken_where_the_kind_is_left_open(tmp_path, stated, taken):
    text = "[campaign]\nencounter_period = 0.4\n"
    for seed, name in enumerate("abcd"):
        # The waves tell all but the noise, which 41 delayed states learn by heart.
        run = arx_run(seed, [], [1.0, -0.5, 0.3], 200, 0.4, 1.0)
        text += written(tmp_path, name, run["eta"], run["heave"])
    model = """state_delays = 40
input_delays = 3
ridge = "rollout"
ridge_scale = "per_snapshot"
delay_rows = "exact"
select = { horizon = 5, memory = true }
"""
    whole = campaign(tmp_path, stated + model, text)
    fitted = fit_campaign(whole)
    assert fitted.settings.kind == taken
    assert "kind = 'fir' errs 0." in fitted.summary()
    assert np.isfinite(fitted.forecast(whole.prepare()["a"], 5.0, 20)["heave"]).all()


WINDOWED = """
kind = "bayesian_hankel_dmdc"
n_members = 4
seed = 7
state_delays = "0.2 T"
input_delays = { uniform = ["1 T", "3 T"] }
ridge = 1e-9
window = { uniform = ["4 T", "8 T"] }
"""
LATE = '[runs.all]\nfile = "run.csv"\ntrain = [100.0, 150.0]\ntest = [150.0, 200.0]\n'


@pytest.mark.parametrize("train_on", ["all", "runs", "windows"])
def test_an_ensemble_learns_inside_the_training_span(halves, train_on):
    ensemble = fit_campaign(campaign(halves, f"{WINDOWED}train_on = '{train_on}'", LATE))
    assert ensemble.n_members == 4
    first, stop = ensemble.training_spans["all"]
    longest = 0.1 * (int(ensemble.draws.window_samples.max()) - 1)
    assert first >= 100.0
    assert stop <= 150.0 + 1e-9
    if train_on == "windows":
        assert len(set(ensemble.draws.last_sample.values)) > 1
    else:
        assert (first, stop) == (pytest.approx(150.0 - longest), pytest.approx(150.0))


REPEATS = (
    r"the input 'eta_fwd' of all repeats training input: .* % of it, such as from t = .* s on, is "
    r"what all holds from t = .* turned by .* memory, not skill: test on another run"
)


def test_a_test_that_repeats_its_training_is_warned_of(tmp_path):
    """A sea of equally spaced components comes back, turned, after 100 s of 200."""
    eta = sea(4, (0.298, 0.698), components=40, jitter=0).at(TIME)
    written(tmp_path, "run", eta, np.roll(eta, 5))
    whole = campaign(tmp_path, EXACT)
    with warned(REPEATS):
        model = fit_campaign(whole)
    with warned(REPEATS):
        compare(model, whole)


def test_an_input_that_is_no_elevation_repeats_no_waves():
    winds, waves = sea(0).at(TIME), [sea(seed).at(TIME) for seed in (4, 5)]
    runs = [
        xr.Dataset({"wind": ("time", winds), "eta": ("time", x)}, {"time": TIME}) for x in waves
    ]
    found = [find_repeat(["wind", "eta"], {"a": runs[0]}, "b", run, TIME[1]) for run in runs]
    assert found[0]["input"] == "eta"
    assert found[1] is None


def test_a_model_table_aligns_and_its_table_says_on_what_it_is_conditional(halves):
    table = pd.read_csv(halves / "run.csv")
    table["x [m]"] = 0.3 * np.sin(table["t [s]"] / 5)
    table.to_csv(halves / "run.csv", index=False)
    # A probe downstream: its waves are carried upstream, to where they were before.
    aligned = EXACT + '\nalignment = { mode = "dispersion", surge = "measured", offset = -0.3 }'
    rig = "[rig]\nwater_depth = 3.6\npositions = { eta_fwd = 1.0 }\n"
    path = edit(
        campaign(halves, aligned).path,
        ("[runs.all]", f'{rig}[channels.surge]\ncolumn = "x"\n[runs.all]\nprobe_offset = 0.1'),
    )
    whole = seakeep.read_campaign(path)
    with warned(r"up to 1\.14 s after the instant"):
        model = fit_campaign(whole)
    expected = seakeep.ProbeAlignment(mode="dispersion", surge="measured", offset=-0.3)
    assert model.alignment.settings == expected
    with warned("ahead of time"):
        found = comparison_table(compare(model, whole)).isel(run=0)
    assert str(found["conditional_on"].values) == "surge"
    assert found["probe_offset"] == 0.1


def sines(*periods):
    """Regular waves, one upon the other, and the heave that they make."""
    eta = sum(np.sin(tau * TIME[:1501] / period) for period in periods)
    return eta, 0.5 * np.roll(eta, 2)


@pytest.mark.parametrize(
    ("period", "words"),
    [
        # The middles of the bands, a sixth of an octave wide, that hold 0.5 s, 1 s and 4 s.
        (2.0, r"1\.89 s lies between the .* model \(1\.06 and 3\.78 s, with none between\);"),
        (8.0, r"7\.55 s lies outside the periods that trained the model \(0\.472 to 4\.24 s\)"),
    ],
)
def test_waves_of_periods_that_were_not_trained_are_warned_of(tmp_path, period, words):
    text = written(tmp_path, "new", *sines(period), role="test")
    for name, each in {"shorter": 0.5, "short": 1.0, "long": 4.0}.items():
        text += written(tmp_path, name, *sines(each))
    asked = campaign(tmp_path, EXACT, text)
    model = fit_campaign(asked)
    with warned(rf"new: eta_fwd: .* of {words}.*Train in such"):
        compare(model, asked)
    write_prepared(asked)
    with warned(rf"new: eta_fwd: .* of {words}"):
        fit_campaign(asked)


def test_a_run_that_disagrees_with_the_others_is_warned_of(tmp_path):
    eta, heave = sines(0.7, 0.83, 0.97, 1.13, 1.37, 1.61)
    text, rng = "", default_rng(0)
    for name, factor in {"a": 1.0, "b": 1.0, "c": 1.8}.items():
        # Without noise the last state alone tells the next one, and its scale.
        noise = 0.1 * rng.standard_normal(eta.size)
        text += written(tmp_path, name, eta, factor * heave + noise)
    with warned(r"c disagrees .*; heave moves 1\.(79|8) times as much"):
        fit_campaign(campaign(tmp_path, EXACT, text))


@pytest.mark.filterwarnings("ignore::seakeep.SeakeepWarning")
def test_a_setting_has_one_score_whether_fit_or_tune_chose_it(halves, command):
    lengths = 'state_delays = "1 T"\ninput_delays = "1 T"\nridge = "rollout"\ndelay_rows = "exact"'
    asked = campaign(halves, f"{lengths}\n[campaign]\nencounter_period = 2.5")  # 2 s is measured
    chosen = fit_campaign(asked)
    assert command("tune", asked.path, "--vary", "ridge")[0].startswith(chosen.selection)


def test_a_lead_reads_waves_ahead_of_time(halves):
    asked = campaign(halves, f"{EXACT}\nlead = 8")
    with warned(r"read the inputs up to 0\.7 s after the instant that"):
        model = fit_campaign(asked)
    with warned(r"of all reads the inputs up to 0\.7 s after"):
        compare(model, asked, steps=20)
    with pytest.warns(SeakeepWarning):
        (whole,) = compare(model, asked)
    # The step to instant k reads the waves of k + 7: seven instants before the end it is the last.
    run = asked.prepare()[whole.run]
    assert whole.forecast["time"][-1] == pytest.approx(float(run["time"][-8]))


def test_a_field_of_a_spec_is_a_key_of_files(monkeypatch, halves):
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
    with request_error(r"no key 'dampign'.*mean 'damping'"):
        fit_campaign(wrong)
