import tomllib

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from altered import altered
from near import assert_near
from said import request_error

from seakeep import read_campaign
from seakeep.tank.play import check_settings, play, truth
from seakeep.tank.settings import SpectrumSettings

pytest.importorskip("numba")


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.parametrize("kind", ["csv", "nc"])
def test_same_seed_same_bytes(short, tmp_path, kind):
    for name in ("one", "two"):
        play(short, tmp_path / name, kind=kind, names=["regular_2"])
    first = contents(tmp_path / "one")
    assert first == contents(tmp_path / "two")
    assert set(first) == {
        "campaign.toml",
        "truth/regular_2.nc",
        *(f"raw/regular_2/{n}.{kind}" for n in ("wave_probes", "mru", "loads", "video")),
    }


def test_raw_csv_reads_back(short, played, tmp_path):
    files = play(short, tmp_path, names=["irregular_1"])["irregular_1"]
    probes = pd.read_csv(files["wave_probes"])
    assert list(probes.columns) == [
        "time [s]", "trigger [V]", "us_fwd [mm]", "us_hml [mm]", "us_bow [mm]", "us_cog [mm]",
        "kn_fwd [mm]", "kn_cog [mm]",
    ]  # fmt: skip
    assert_near(probes["time [s]"], np.arange(15001) / 500.0, 1e-9)
    video = pd.read_csv(files["video"])
    # Six decimals hold a thirtieth of a second to half a microsecond.
    assert_near(video["time [s]"], np.arange(901) / 30.0, 6e-7)
    true = truth(played, "irregular_1", 0.002)
    error = 1e-3 * probes["kn_cog [mm]"].to_numpy() - true["eta_kn_cog"] - true["eta_kn_cog_crest"]
    assert error.std() == pytest.approx(6e-4, rel=0.03)


def test_campaign_file_lists_all_files_clocks_and_spans(short, tmp_path):
    play(short, tmp_path)
    table = tomllib.loads((tmp_path / "campaign.toml").read_text("utf-8"))
    assert table["instruments"]["video"]["trigger"] == "lamp"
    run = table["runs"]["irregular_1"]
    assert (run["train"], run["test"]) == ([10, 20], [20, 30])
    assert table["runs"]["regular_2"]["span"] == [10, 30]
    assert table["runs"]["regular_2"]["role"] == "test"
    for files in (r["files"] for r in table["runs"].values()):
        assert set(files) == {"wave_probes", "mru", "loads", "video"}
        for path in files.values():
            assert (tmp_path / path).is_file()
            assert not path.startswith("truth")
    assert "offset" not in (tmp_path / "campaign.toml").read_text("utf-8")
    assert table["derived"]["eta_fwd"] == {
        "from": "eta_kn_fwd", "step": "low_pass", "passband": 10.0, "stopband": 10.75,
    }  # fmt: skip


def test_the_command_plays_one_logger_whose_campaign_can_be_prepared(tmp_path, command):
    short, out = tmp_path / "short.toml", tmp_path / "out"
    short.write_text(
        "[runs.sea]\nstartup = 10.0\nduration = 20.0\n"
        "spectrum = { height = 0.15, peak_period = 2.0 }\n"
        "[runs.regular]\nstartup = 5.0\nduration = 20.0\nwavelength = 2.8\nheight = 0.1\n",
        "utf-8",
    )
    command("tank", "--settings", short, "--out", out, "--seed", 3, "--one-logger", "--run", "sea")
    assert (out / "raw/sea/all.csv").is_file()
    run = read_campaign(out / "campaign.toml").prepare()["sea"]
    assert {"surge", "heave_rate", "pitch_acceleration", "mooring_stern", "eta_cog"} <= set(run)
    true = xr.load_dataset(out / "truth/sea.nc")
    # Noise of 0.8 mm, most of it above the new Nyquist frequency.
    assert (run["heave"] - np.interp(run["time"], true["time"], true["heave"])).std() < 1e-3
    rate = np.interp(run["time"], true["time"], true["heave_rate"])
    middle = slice(100, -100)
    assert (run["heave_rate"] - rate)[middle].std() < 0.15 * rate[middle].std()


def test_nothing_that_the_tank_has_not_written_is_replaced(short, tmp_path):
    def again():
        play(short, tmp_path, names=["regular_2"])

    again()
    again()  # its own files it replaces
    record = tmp_path / "raw" / "regular_2" / "mru.csv"
    kept = record.read_text("utf-8")
    record.write_text("time [s],heave [m]\n0.0,0.1\n", "utf-8")
    with request_error(r"mru\.csv exists and is not a raw file that"):
        again()
    record.write_text(kept, "utf-8")
    hidden = (tmp_path / "truth").rename(tmp_path / "apart")
    with request_error(r"\w+\.csv exists, and no truth of the tank beside it"):
        again()
    hidden.rename(tmp_path / "truth")
    (tmp_path / "campaign.toml").write_text("[campaign]\nname = 'mine'\n", "utf-8")
    before = contents(tmp_path)
    with request_error(r"campaign\.toml exists and is not a campaign"):
        again()
    assert contents(tmp_path) == before


def test_seas_beyond_the_coefficients_are_refused(short):
    facility = altered(short.facility, wave_band=(0.01, 5.0))
    spectrum = SpectrumSettings(height=0.1, peak_period=2.0, band=(0.3, 3.0))
    run = altered(short.runs["irregular_1"], spectrum=spectrum)
    bad = altered(short, facility=facility, runs={"wide": run})
    with request_error(r"runs\.wide: frequencies .* leave the band"):
        check_settings(bad)
