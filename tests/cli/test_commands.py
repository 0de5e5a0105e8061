"""Every verb, run as a user runs it, on the tutorial's campaign."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import seakeep
from seakeep import cli
from seakeep.cli import modelling

ROOT = Path(__file__).parents[2]
TUTORIAL = ROOT / "docs" / "tutorial"
VERBS = ("tank", "init", "prepare", "fit", "forecast", "compare", "datasets", "info")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the tutorial where its examples expect it, and a model."""
    folder = tmp_path_factory.mktemp("place")
    (folder / "docs").mkdir()
    shutil.copytree(
        TUTORIAL, folder / "docs" / "tutorial", ignore=shutil.ignore_patterns("prepared", "*.md")
    )
    assert (
        cli.main(
            ["fit", str(folder / "docs/tutorial/campaign.toml"), "-o", str(folder / "model.nc")]
        )
        == 0
    )
    return folder


@pytest.fixture
def run(place, monkeypatch, capsys):
    monkeypatch.chdir(place)

    def call(text):
        status = cli.main(shlex.split(text))
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


CAMPAIGN = "docs/tutorial/campaign.toml"


def test_the_entry_point_and_the_module_are_one_program():
    answers = [
        subprocess.run([*command, "--version"], capture_output=True, text=True, check=True).stdout
        for command in (
            [sys.executable, "-m", "seakeep"],
            [sys.executable, "-c", "import sys; from seakeep.cli import main; sys.exit(main())"],
        )
    ]
    assert answers == [f"seakeep {seakeep.__version__}\n"] * 2


@pytest.mark.parametrize("verb", VERBS)
def test_the_example_of_each_help_runs(verb, run, place):
    """What --help shows works as it stands (fetching aside: it needs the network)."""
    if verb == "tank":
        pytest.importorskip("numba")
    status, out, _ = run(f"{verb} --help")
    assert status == 0
    example = re.search(r"Example: (seakeep .*?)(?:\n\n|\Z)", out, re.DOTALL)
    assert example, f"the help of {verb} has no example"
    words = " ".join(example[1].split())
    if verb == "init":
        words = words.replace("campaign.toml", "draft.toml")
    status, _, err = run(words.removeprefix("seakeep "))
    shutil.rmtree(place / "docs/tutorial/prepared", ignore_errors=True)
    assert status == 0, err


def test_help_lists_every_verb(run):
    status, out, _ = run("--help")
    assert status == 0
    for verb in VERBS:
        assert re.search(rf"^  {verb}\s", out, re.MULTILINE)


def test_fit_prints_what_was_identified_on_stdout_and_the_rest_on_stderr(run, place):
    status, out, err = run(f"fit {CAMPAIGN} -o again.nc")
    assert status == 0
    assert "5 states, 2 inputs, dt 0.08 s" in out
    assert "spectral radius" in out
    assert "Wrote again.nc" in err
    assert "Preparing 1/2: first" in err
    assert seakeep.load_model(place / "again.nc").states[0] == "heave"


def test_forecast_writes_netcdf_and_csv_alike(run, place):
    for name in ("f.nc", "f.csv"):
        status, out, err = run(
            f"forecast model.nc {CAMPAIGN} --run unseen --start 20.01 --steps 50 -o {name}"
        )
        assert (status, out) == (0, "")
        assert "50 instants after t = 20 s, status ok" in err
    with xr.open_dataset(place / "f.nc", engine="h5netcdf") as stored:
        heave = stored["heave"].values
    table = np.genfromtxt(place / "f.csv", delimiter=",", names=True, deletechars="")
    assert list(table.dtype.names[:2]) == ["time_[s]", "heave_[m]"]
    np.testing.assert_array_equal(table["heave_[m]"], heave)  # CSV keeps all digits


def test_compare_without_matplotlib_judges_and_says_what_is_missing(run, place, monkeypatch):
    monkeypatch.setattr(modelling, "find_spec", lambda name: None)
    status, out, err = run(f"compare model.nc {CAMPAIGN} -o plain")
    assert status == 0
    assert "NRMSE" in out
    assert "no figures, because matplotlib is not installed. Install it with: pip" in err
    assert [path.name for path in (place / "plain").iterdir()] == ["comparison.csv"]


def test_compare_prints_the_table_and_writes_figure_and_csv(run, place):
    pytest.importorskip("matplotlib")
    status, out, err = run(f"compare model.nc {CAMPAIGN} -o judged --format svg")
    assert status == 0
    header = next(line for line in out.splitlines() if "NRMSE" in line)
    for heading in ("channel", "unit", "fit %", "NAMMAE", "SD ratio", "max meas.", "max pred."):
        assert heading in header
    pitch = next(line for line in out.splitlines() if " pitch " in line)
    assert "deg" in pitch
    assert (place / "judged/unseen.svg").read_text().startswith("<?xml")
    rows = (place / "judged/comparison.csv").read_text().splitlines()
    assert len(rows) == 1 + 5
    assert "judged/unseen.svg" in err


def test_compare_keeps_radians_if_asked(run):
    _, out, _ = run(f"compare model.nc {CAMPAIGN} -o judged --radians")
    assert " rad " in next(line for line in out.splitlines() if " pitch " in line)


def test_prepared_files_are_used_while_fresh(run, place, monkeypatch):
    status, out, _ = run(f"prepare {CAMPAIGN} -o docs/tutorial/prepared")
    assert status == 0
    assert [Path(line).name for line in out.split()] == ["first.nc", "second.nc", "unseen.nc"]

    def refuse(*_args, **_keywords):
        raise AssertionError("the raw file was read again")

    monkeypatch.setattr(seakeep.Campaign, "prepare", refuse)
    status, _, err = run(f"compare model.nc {CAMPAIGN} -o judged")
    assert status == 0, err
    shutil.rmtree(place / "docs/tutorial/prepared")


@pytest.mark.parametrize(
    ("command", "status", "message"),
    [
        ("fit missing.toml -o m.nc", 2, r"missing\.toml does not exist\. Draft one with"),
        (f"fit {CAMPAIGN} -o no/such/m.nc", 2, r"the folder no/such does not exist"),
        (f"fit {CAMPAIGN} -o m.nc --model sway", 2, r"no table \[models\.sway\]"),
        (f"compare missing.nc {CAMPAIGN}", 2, r"no model file missing\.nc"),
        (f"compare model.nc {CAMPAIGN} --run unsen", 2, r"no run 'unsen'\. Did you mean 'unseen'"),
        (f"compare model.nc {CAMPAIGN} --format bmp", 2, r"--format must be png, svg or pdf"),
        (f"forecast model.nc {CAMPAIGN} --run unseen --start 2 -o f.nc", 2, r"55 are missing"),
        (
            f"forecast model.nc {CAMPAIGN} --run unsen --start 9 -o f.nc",
            2,
            r"Did you mean 'unseen'",
        ),
        (f"forecast model.nc {CAMPAIGN} --run unseen --start 9 -o f.txt", 2, r"\.nc or \.csv"),
        (f"prepare {CAMPAIGN} -o model.nc", 2, r"cannot make the folder model\.nc: File exists"),
        (f"fit {CAMPAIGN} -o .", 2, r"cannot write \.: it is a folder\. Name a file in it"),
        (f"compare . {CAMPAIGN}", 2, r"\. is a folder\. Name the model file in it"),
        (f"compare {CAMPAIGN} model.nc", 2, r"is a campaign file, and a model file is expected"),
        ("datasets fetch ntnu", 2, r"no data set 'ntnu'\."),
        ("fitt", 2, r"Did you mean 'fit'"),
        (f"fit {CAMPAIGN}", 2, r"Missing option '-o'"),
    ],
)
def test_a_mistake_gets_one_message_and_no_traceback(command, status, message, run):
    got, out, err = run(command)
    assert got == status
    assert re.search(message, err)
    assert "Traceback" not in out + err


def test_debug_shows_the_traceback(run):
    status, _, err = run("--debug fit missing.toml -o m.nc")
    assert status == 2
    assert "Traceback" in err


def test_a_draft_is_not_overwritten(run, place):
    (place / "mine.toml").write_text("precious")
    status, _, err = run("init docs/tutorial/run1.csv -o mine.toml")
    assert status == 2
    assert "mine.toml exists already" in err
    assert (place / "mine.toml").read_text() == "precious"


def test_ctrl_c_ends_with_130_and_says_what_is_kept(run, monkeypatch):
    def interrupt(*_args, **_keywords):
        raise KeyboardInterrupt

    monkeypatch.setattr(modelling, "fit_campaign", interrupt)
    status, _, err = run(f"fit {CAMPAIGN} -o m.nc")
    assert status == 130
    assert "Interrupted. Files that were finished are kept." in err


def test_an_unforeseen_error_asks_for_a_report(run, monkeypatch):
    def fail(*_args, **_keywords):
        raise RuntimeError("the tank is empty")

    monkeypatch.setattr(modelling, "fit_campaign", fail)
    status, _, err = run(f"fit {CAMPAIGN} -o m.nc")
    assert status == 1
    assert "RuntimeError: the tank is empty. This is a fault of seakeep" in err


def test_a_diverging_forecast_is_told_and_ends_with_1(run, place):
    text = (place / CAMPAIGN).read_text()
    unstable = text.replace(
        'preset = "recommended"', "state_delays = 60\ninput_delays = 5\nridge = 0.0"
    )
    (place / "docs/tutorial/unstable.toml").write_text(unstable)
    status, _, err = run("fit docs/tutorial/unstable.toml -o unstable.nc")
    assert status == 0
    assert "Note: the spectral radius of the model is" in err
    assert "Raise ridge" in err


def test_datasets_lists_origin_licence_and_state(run, monkeypatch):
    monkeypatch.delenv("SEAKEEP_DATA_DIR", raising=False)
    status, out, _ = run("datasets")
    assert status == 0
    for text in ("CC0-1.0", "MIT", "2465cee", "9279ed4", "SEAKEEP_DATA_DIR is not set", "[m]"):
        assert text in out


def test_info_names_versions(run):
    status, out, _ = run("info")
    assert status == 0
    assert f"seakeep {seakeep.__version__}" in out
    assert f"numpy {np.__version__}" in out


def test_full_scale_by_froudes_law(run, place):
    text = (place / CAMPAIGN).read_text(encoding="utf-8")
    scaled = place / "docs/tutorial/scaled.toml"
    scaled.write_text(re.sub(r"scale_factor.*\n", "", text), encoding="utf-8")
    command = "forecast model.nc {} --run unseen --start 20 --steps 100 -o {}.nc"
    status, _, err = run(command.format(scaled, "none") + " --full-scale")
    assert status == 2
    assert "--full-scale needs the scale factor" in err
    scaled.write_text(
        scaled.read_text().replace("[campaign]", "[campaign]\nscale_factor = 25.0", 1),
        encoding="utf-8",
    )
    assert run(command.format(scaled, "model_scale"))[0] == 0
    assert run(command.format(scaled, "full_scale") + " --full-scale")[0] == 0
    small, full = (xr.load_dataset(place / f"{n}_scale.nc") for n in ("model", "full"))
    # Froude: lengths by the scale, times by its root, so rates by 1/root; loads by its cube.
    by = {"heave": 25, "pitch": 1, "heave_rate": 5, "pitch_rate": 1 / 5, "mooring_bow": 25**3}
    assert set(by) == set(full.data_vars)
    for name, factor in by.items():
        np.testing.assert_allclose(full[name], factor * small[name], rtol=1e-12)
        assert full[name].attrs["units"] == small[name].attrs["units"]
    np.testing.assert_allclose(full["time"], 5 * small["time"], rtol=1e-12)
    assert full.attrs["start"] == pytest.approx(5 * small.attrs["start"], rel=1e-12)
    assert (full.attrs["scale"], full.attrs["scale_factor"]) == ("full", 25.0)

    compared = []
    for out, option in (("small", ""), ("large", " --full-scale")):
        status, _, err = run(f"compare model.nc {scaled} -o {out} --radians{option}")
        assert status == 0, err
        rows = (place / out / "comparison.csv").read_text().splitlines()
        header = rows[0].split(",")
        compared.append([dict(zip(header, row.split(","), strict=True)) for row in rows[1:]])
    for model, large in zip(*compared, strict=True):
        assert model["channel"] == large["channel"]
        for key in model:
            if key.split()[0].split("_")[0] in ("measured", "predicted"):
                expected = by[model["channel"]] * float(model[key])
                assert float(large[key]) == pytest.approx(expected, rel=1e-9), key
            elif key in ("nrmse", "fit", "nammae", "sd_ratio", "anrmse"):
                assert float(large[key]) == pytest.approx(float(model[key]), rel=1e-9)
        assert float(large["start"]) == pytest.approx(5 * float(model["start"]), rel=1e-9)
