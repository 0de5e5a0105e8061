"""Every verb, run as a user runs it, on the tutorial's campaign."""

import importlib.util
import re
import shlex
import shutil
from unittest.mock import ANY

import pytest
import xarray as xr
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from tables import rows_of
from tutorial_study import edit, put_tutorial

import seakeep
from seakeep import cli

VERBS = ("tank", "init", "prepare", "fit", "calibrate", "forecast", "compare", "export", "datasets",
         "info")  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the tutorial where its examples expect it, and a model."""
    folder = tmp_path_factory.mktemp("place")
    tutorial = folder / "docs/tutorial"
    tutorial.mkdir(parents=True)
    put_tutorial(tutorial)
    # The commands are the same with fewer members, and faster.
    fit = ["fit", str(edit(tutorial / "campaign.toml", ("n_members = 40", "n_members = 8"))), "-o"]
    assert cli.main([*fit, str(folder / "model.nc")]) == 0
    assert cli.main([*fit, str(folder / "ensemble.nc"), "--model", "ensemble"]) == 0
    return folder


@pytest.fixture
def run(place, monkeypatch, command, empty_figures):
    monkeypatch.chdir(place)
    return lambda text, status=0: command(*shlex.split(text), status=status)


CAMPAIGN = "docs/tutorial/campaign.toml"


@pytest.mark.parametrize("verb", VERBS)
def test_the_example_of_each_help_runs(verb, run, place, monkeypatch):
    """What --help shows runs; fetching needs the network, and playing the tank takes minutes."""
    if verb == "tank":
        pytest.importorskip("numba")
        monkeypatch.setattr("seakeep.tank.play.play", lambda *_, **__: {})  # as tests/tank does
    out, _ = run(f"{verb} --help")
    examples = re.findall(
        r"(?:Example|An ensemble|A model|Two models|In service): (seakeep .*?)(?:\n\n|\Z)",
        out,
        re.DOTALL,
    )
    assert len(examples) == {"fit": 2, "forecast": 2, "compare": 3, "info": 2}.get(verb, 1)
    for example in examples:
        words = " ".join(example.split())
        if verb == "compare" and "--steps" not in words:
            words += " --steps 200"  # for all that the waves drive, which other tests judge
        if verb == "init":
            words = words.replace("campaign.toml", "draft.toml")
        run(words.removeprefix("seakeep "))
        shutil.rmtree(place / "docs/tutorial/prepared", ignore_errors=True)


def test_forecast_writes_netcdf_and_csv_alike(run, place):
    for name in ("f.nc", "f.csv"):
        out, err = run(
            f"forecast model.nc {CAMPAIGN} --run unseen --start 20.01 --steps 50 -o {name}"
        )
        assert not out
        assert "50 instants after t = 20 s, status ok" in err
    heave = [float(row["heave [m]"]) for row in rows_of(place / "f.csv")]
    assert_array_equal(xr.load_dataset(place / "f.nc")["heave"], heave)  # all digits


FROM_20 = f"{CAMPAIGN} --run unseen --start 20 --steps 50"
FORECAST = f"forecast model.nc {FROM_20}"


def test_forecast_goes_beyond_the_waves_when_it_may_predict_them(run):
    command = f"forecast model.nc {CAMPAIGN} --run unseen --start 110 --steps 200 -o beyond.nc"
    assert "ahead = 'predict' continues the input" in run(command, 2)[1]
    _, err = run(f"{command} --ahead predict")
    assert re.search(
        r"200 instants after t = [\d.]+ s, status ok, input predicted from t = \d", err
    )


def test_the_margin_of_a_calibrated_band_is_that_of_the_ensemble(run, place):
    """What is printed, and what `compare` makes of it: `tests/docs/test_pages.py`."""
    calibrate = f"calibrate ensemble.nc {CAMPAIGN} --run unseen --stop 60 --steps 200 -o wide.nc"
    out, _ = run(f"{calibrate} --level 0.9 --scale constant")
    assert "Margin of the 90 % band, from 3 windows of 200 instants (unseen)" in out
    ensemble = seakeep.load_model(place / "ensemble.nc")
    unseen = seakeep.read_campaign(place / CAMPAIGN).prepare(names=["unseen"])["unseen"]
    part = unseen.sel(time=slice(None, 60.001))
    expected = ensemble.calibrate(part, steps=200, level=0.9, scale="constant")
    margin = expected.calibration.conformal.margin
    assert_array_equal(seakeep.load_model(place / "wide.nc").calibration.conformal.margin, margin)
    _, err = run(f"forecast wide.nc {FROM_20} --band calibrated -o wide_band.nc")
    assert "mean, std and 90 % calibrated band of 8 members" in err
    stored = xr.load_dataset(place / "wide_band.nc")["heave"].sel(statistic="upper")
    band = ensemble.forecast_summary(unseen, 20.0, 50, 0.9)["heave"].sel(statistic="upper")
    assert_array_equal(stored, band + margin[0])


def test_compare_judges_models_in_service_against_lead_time(run, place):
    pytest.importorskip("matplotlib")
    out, err = run(f"compare model.nc {CAMPAIGN} --nowcast --steps '1 T' -o served")
    assert "unseen: model in service" in out
    assert "lead time s" in out
    rows = rows_of(place / "served/nowcast.csv")
    assert {"model", "run", "lead", "claimed", "coverage", "lead_time"} < set(rows[0])
    errors = [float(row["error"]) for row in rows if row["channel"] == "heave"]
    assert len(errors) == 16  # steps of an encounter period
    assert errors[0] < errors[-1]
    assert "served/nowcast.csv, served/nowcast_unseen.png" in err


def test_several_models_are_judged_over_the_same_instants(run, place):
    out, _ = run(f"compare model.nc ensemble.nc {CAMPAIGN} --steps 200 -o both --format svg")
    assert "unseen: models against measurement" in out
    rows = rows_of(place / "both/comparison.csv")
    assert {row["model"] for row in rows} == {"model", "ensemble"}
    assert len({row["start"] for row in rows}) == 1
    alone = [row for row in rows if row["model"] == "ensemble"]
    run(f"compare ensemble.nc {CAMPAIGN} -o alone --steps 200 --start {rows[0]['start']}")
    first, second = (
        {row["channel"]: row["nrmse"] for row in each}
        for each in (alone, rows_of(place / "alone/comparison.csv"))
    )
    assert first == second
    drawn = importlib.util.find_spec("matplotlib") is not None
    for name in ("unseen", "errors_by_run"):
        assert (place / f"both/{name}.svg").exists() == drawn
    assert "unseen: change of ANRMSE from model" in out
    changes = rows_of(place / "both/differences.csv")
    assert [row["model"] for row in changes] == 2 * ["model", "ensemble"]


def test_baselines_stand_beside_a_model_and_their_loss_is_not_its_own(run, place):
    out, _ = run(f"compare model.nc {CAMPAIGN} --baselines -o based")
    tables, sentence = out.split("Least error: ")
    assert sentence.startswith("model") or "seakeep fit" in sentence or "Keep model." in sentence
    assert max(len(line.rstrip()) for line in tables.splitlines()) <= 80
    rows = rows_of(place / "based/comparison.csv")
    kinds = {"model", "hold_last", "mean", "fir", "arx", "subspace"}
    assert {row["model"] for row in rows} == kinds
    mean = next(row for row in rows if row["model"] == "mean")
    assert_near(float(mean["nrmse"]), 1.0, 0.01)


def test_what_a_forecast_refuses_stops_before_baselines_are_fitted(run, monkeypatch):
    monkeypatch.setattr("seakeep.study.fit_baselines", None)
    _, err = run(f"compare model.nc {CAMPAIGN} --baselines --start 900", 2)
    assert "start = 900 s is outside unseen" in err


MISTAKES = {
    "fit missing.toml -o m.nc": r"missing\.toml does not exist\..* Draft one with",
    f"fit {CAMPAIGN} -o m.nc --model sway": r"no table \[models\.sway\]",
    f"compare model.nc {CAMPAIGN} --run unsen": r"no run 'unsen'\. Did you mean 'unseen'",
    f"compare model.nc {CAMPAIGN} --format bmp": r"'bmp' is not one of 'png', 'svg', 'pdf'",
    f"forecast model.nc {CAMPAIGN} --run unseen --start 2 -o f.nc": r"55 are missing",
    f"forecast model.nc {CAMPAIGN} --run unseen --start 9 -o f.txt": r"\.nc or \.csv",
    f"forecast model.nc {FROM_20} --members -o f.nc": r"--members is for ensembles, and",
    f"compare model.nc {CAMPAIGN} --level 0.9": r"--level is for ensembles, and",
    f"forecast ensemble.nc {FROM_20} --members --level 0.9 -o f.nc":
        r"--level belongs to the band, and --members writes the members without it\. Leave one",
    f"compare ensemble.nc {CAMPAIGN} --band calibrated":
        r"the ensemble is not calibrated.*seakeep calibrate",
    f"compare ensemble.nc {CAMPAIGN} --nowcast --band members": r"--band and --nowcast do",
    f"compare model.nc {CAMPAIGN} --nowcast --steps 9999": r"a forecast of 9999 steps",
    f"calibrate model.nc {CAMPAIGN} --steps 100 -o c.nc":
        r"model\.nc holds a single model, which has no band\. Fit an ensemble",
    f"fit {CAMPAIGN} -o m.mat": r"m\.mat ends in '\.mat', and a file of the kind \.nc",
    f"calibrate ensemble.nc {CAMPAIGN} --steps 100 --run unseen --stop 900 -o c.nc":
        r"--stop 900 \(900 s\) lies in none of the runs \(unseen: [\d.]+ to [\d.]+ s\)",
    f"calibrate ensemble.nc {CAMPAIGN} --steps 9 --run unseen --start 20 --stop 20 -o c.nc":
        r"--start 20 \(20 s\) lies at or after --stop 20 \(20 s\)",
    f"forecast model.nc {FROM_20} --scheduler tcp://127.0.0.1:9 -o f.nc":
        r"--scheduler is for ensembles, and",
    f"calibrate ensemble.nc {CAMPAIGN} --steps 900 --run unseen --stop 30 -o c.nc":
        r"no window of 900 steps with \d+ samples of history is free in unseen, .* most \d+ .*"
        r"by what the others teach \(folds='run', --folds run of seakeep calibrate\)",
    f"forecast ensemble.nc {FROM_20} --workers 2 --scheduler tcp://h:1 -o f.nc":
        r"--workers 2 counts processes on this machine, and --scheduler tcp://h:1 hands all",
    f"forecast ensemble.nc {FROM_20} --level 95 -o f.nc": r"level must be between 0 and 1",
    f"forecast model.nc {CAMPAIGN} --run unseen --start soon -o f.nc":
        r"--start: received 'soon'\. Give seconds such as 20, or encounter periods such as",
    f"forecast model.nc {CAMPAIGN} --run unseen --start 20,5 -o f.nc":
        r"--start: received '20,5'\. Give seconds .*\. Write a decimal point, no comma\.",
    f"compare model.nc {CAMPAIGN} --steps 12.5":
        r"steps: received '12\.5'\. Give a whole number such as 400, or encounter periods",
    f"forecast model.nc {CAMPAIGN} --run unseen --start 1e400 -o f.nc":
        r"--start: received '1e400'\. Give an instant within the run, s\.",
    "prepare ~seakeep-nobody/c.toml": r"cannot be read: .*home directory",
    f"compare model.nc {CAMPAIGN} --steps {5000 * '1'}":
        r"steps: received '1{12}\.\.\.1{13}'\. Give a whole number",
    f"compare model.nc {CAMPAIGN} --steps 1": r"has 1 measured instant.* earlier start",
    f"compare model.nc {CAMPAIGN} --steps 7": r"of \w+ from .* 7 measured .* over 8 or more",
    f"forecast ensemble.nc {FROM_20} -o no/f.nc": r"the folder no does not exist",
    f"fit {CAMPAIGN} -o m.nc --workers 0": r"Invalid value for '--workers'",
    f"prepare {CAMPAIGN} -o model.nc": r"cannot make the folder model\.nc: File exists",
    f"fit {CAMPAIGN} -o .": r"cannot write \.: it is a folder\. Name a file\.",
    f"compare . {CAMPAIGN}": r"\. is a folder, .* A model file is expected here",
    f"compare {CAMPAIGN} model.nc": r"is a campaign file, and a model file is expected",
    "datasets fetch ntnu": r"no data set 'ntnu'\.",
    "fitt": r"Did you mean 'fit'",
    f"fit {CAMPAIGN}": r"Missing option '-o'",
    f"compare model.nc {CAMPAIGN} --nowcast --radians": r"--radians and --nowcast do not",
    f"forecast model.nc {FROM_20} --full-scale -o f.nc": r"--full-scale needs the scale factor",
}  # fmt: skip


@pytest.mark.parametrize(("line", "message"), MISTAKES.items())
def test_a_mistake_gets_one_message_and_no_traceback(line, message, run):
    out, err = run(line, 2)
    assert re.search(message, err)
    assert "Traceback" not in out + err


@pytest.mark.parametrize(
    ("line", "kept"),
    {
        f"fit {CAMPAIGN} -o docs/tutorial/raw.nc": "docs/tutorial/raw.nc",
        f"calibrate ensemble.nc {CAMPAIGN} --run unseen --steps 200 -o ensemble.nc": "ensemble.nc",
        f"{FORECAST} -o model.nc": "model.nc",
        f"{FORECAST} -o docs/tutorial/run3.csv": "docs/tutorial/run3.csv",
        f"{FORECAST} -o other.csv": "other.csv",
        f"{FORECAST} -o lf.csv": "lf.csv",
        f"{FORECAST} -o crlf.csv": "crlf.csv",
        f"compare model.nc {CAMPAIGN} -o mine": "mine/comparison.csv",
        f"check model.nc {CAMPAIGN} -o checked": "checked/tables/modes.csv",
        f"tune {CAMPAIGN} --vary rank": "docs/tutorial/campaign_tuned.png",
        f"prepare --anew {CAMPAIGN} -o sheets": "sheets/quality_first.png",
        f"compare model.nc {CAMPAIGN} -o drawn": "drawn/unseen.png",
    }.items(),
)
def test_no_output_replaces_an_input_or_a_file_of_others(line, kept, run, place, monkeypatch):
    if "drawn" in line:
        pytest.importorskip("matplotlib")
    for name, text in {
        "docs/tutorial/raw.nc": "CDF\x01",
        "other.csv": "time [s],heave [m],WP_01 [m]\n",
        "lf.csv": "time [s],heave [m],pitch [rad]\n0.0,1.0,2.0\n",
        "crlf.csv": "time [s],heave [m],pitch [rad]\r\n0.0,1.0,2.0\r\n",
        "checked/tables/modes.csv": "mine",
        "docs/tutorial/campaign_tuned.png": "a photograph",
        "mine/comparison.csv": "run,rating\n",
        "drawn/unseen.png": "a photograph",
        "sheets/quality_first.png": "a photograph",
    }.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(text, newline="")
    monkeypatch.setattr("seakeep.campaign.prepare.Campaign.prepare", None)  # no work is done
    before = (place / kept).read_bytes()
    assert "Choose another " in run(line, 2)[1]
    assert (place / kept).read_bytes() == before


def test_info_describes_a_model_file(run, place):
    out, err = run("info model.nc")
    assert out == f"{seakeep.load_model(place / 'model.nc').summary()}\n"
    assert not err
    assert "is a folder" in run("info .", 2)[1]


def test_datasets_lists_origin_licence_and_state(run, monkeypatch):
    monkeypatch.delenv("SEAKEEP_DATA_DIR", raising=False)
    out, _ = run("datasets")
    for text in ("CC0-1.0", "MIT", "2465cee", "9279ed4", "SEAKEEP_DATA_DIR is not set", "[m]"):
        assert text in out


def test_full_scale_by_froudes_law(run, place):
    scaled = shutil.copy(place / CAMPAIGN, place / "docs/tutorial/scaled.toml")
    command = "forecast model.nc {} --run unseen --start 20 --steps 100 -o {}.nc"
    edit(scaled, ("[campaign]", "[campaign]\nscale_factor = 25.0"))
    run(command.format(scaled, "model_scale"))
    _, err = run(command.format(scaled, "full_scale") + " --full-scale")
    assert "at full scale (1:25); notes, --start and --steps are at model scale." in err
    small, full = (xr.load_dataset(place / f"{n}_scale.nc") for n in ("model", "full"))
    assert_allclose(full["heave"], 25 * small["heave"], rtol=1e-12)
    assert_allclose(full.attrs["start"], 5 * small.attrs["start"], rtol=1e-12)


def test_commands_report_what_prepare_finds(run, place, tmp_path, monkeypatch):
    """One -9999 in heave took NRMSE from 0.028 to 3.03 without a word."""
    folder = tmp_path / "spoilt"
    shutil.copytree(place / "docs" / "tutorial", folder)
    for name in ("run1.csv", "run2.csv", "run3.csv"):
        lines = (folder / name).read_text("utf-8").splitlines()
        fields = lines[900].split(";")
        lines[900] = ";".join([fields[0], *("-9999" for _ in fields[1:])])
        (folder / name).write_text("\n".join(lines) + "\n", "utf-8")
    campaign, found = folder / "campaign.toml", ": heave outlier: 1 samples in 1 place(s)"
    assert f"Note: first{found}" in run(f"fit {campaign} -o {folder}/m.nc")[1]
    assert f"unseen{found}" in run(f"compare {folder}/m.nc {campaign}")[1]
    steps = f"{campaign} --run unseen --steps"
    # The note comes before the work.
    monkeypatch.setattr(importlib.import_module("seakeep.study.comparison"), "nowcast", None)
    monkeypatch.setattr(seakeep.HankelEnsemble, "calibrate", None)
    monkeypatch.setattr("seakeep.study.fit_baselines", None)
    for command in (
        f"forecast {folder}/m.nc {steps} 50 --start 20 -o {folder}/f.nc",
        f"compare {folder}/m.nc {steps} 2 -o {folder}/now --nowcast",
        f"calibrate ensemble.nc {steps} 200 --stop 60 -o {folder}/c.nc",
        f"check {folder}/m.nc {campaign} --run unseen -o {folder}/checked",
    ):
        assert f"unseen{found}" in run(command, ANY)[1]  # what follows the note is taken away
