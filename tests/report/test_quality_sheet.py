"""The data-quality sheet, and what it says of the measured ship section."""

import re

import numpy as np
import pytest
from near import assert_near
from records import record
from small_tank import CAMPAIGN, campaign_of, tank_columns, write_csv

from seakeep.quality import Finding, as_json, findings_of
from seakeep.quality.samples import SamplesKind

pytest.importorskip("matplotlib")

RUNS = "3101_3 3101_4 3102_1 3102_2 3111_2 3041_2 3061_2 3102_3 3012_1 3102_4 3061_1 3142_1 3031_2"
CAMERAS = """
[channels.acc_sb]
column = "ACC_Heave_SB"
[channels.acc_ps]
column = "ACC_HEAVE_PS"
[channels.heave_of_the_camera]
column = "Heave"
[derived.heave_acceleration]
expression = "average(acc_sb, acc_ps)"
[derived.heave]
from = "heave_acceleration"
step = "integrate"
times = 2
band = [0.4, 5.0]
[redundant.heave]
channels = ["heave", "heave_of_the_camera"]
[preparation]
sampling_rate = 25
"""


@pytest.mark.data
def test_cameras_that_differ_by_more_than_a_model_errs_are_flagged(tmp_path):
    """The camera tells a tenth less motion in all runs, and its phase wanders."""
    runs = [
        f'[runs.{n}]\nfile = "${{SEAKEEP_DATA_DIR}}/ntnu_ship_section/{n}.csv"\n'
        for n in RUNS.split()
    ]
    found = {
        name: {e.kind.name: e.value for e in findings_of(run) if e.channel == "heave_of_the_camera"}
        for name, run in campaign_of(tmp_path, CAMERAS + "".join(runs)).prepare().items()
    }
    assert all(found.values())
    assert set(found["3102_4"]) == {"CONSTANT", "STILL"}
    assert found["3061_1"] == {"LAG": pytest.approx(-0.38, abs=0.03)}  # the camera is early
    assert set(found["3142_1"]) == {"STUCK", "RESOLUTION", "AGREEMENT"}  # and not SATURATED
    # Half of the camera's pixel of 0.9 mm: each reading is a mean over several markers.
    assert_near(found["3142_1"]["RESOLUTION"], 0.00047, 1e-5)
    assert_near(found["3031_2"]["LAG_GROWS"], 0.55, 0.1)
    assert_near(found["3061_2"]["LAG_GROWS"], -0.33, 0.1)


def test_angles_are_in_degrees_and_missing_samples_lie_in_their_gap():
    from seakeep.quality.faults import FLAGS
    from seakeep.quality.sensors import LATE, Agreement
    from seakeep.report.figures.histories import quality_figure
    from seakeep.report.quality_sheet import channel_rows

    time = 0.1 * np.arange(101)
    heave = 3.0 + np.sin(time)
    flags = np.zeros(time.size, dtype=np.int16)
    flags[40:45] = FLAGS["missing"]
    heave[40:45] = np.nan
    found = {"quality": as_json([Finding(SamplesKind.CONSTANT, "first", "heave", 1.0)])}
    line = record(0.1, mooring_bow=2.5e6 + 1e6 * np.sin(time))
    run = record(0.1, found, heave=heave, pitch=np.deg2rad(5.0) * np.sin(time)).merge(line)
    run = run.assign_coords(heave_flags=("time", flags))
    rows = {name: cells for name, *cells in channel_rows(run)}
    assert rows["pitch"][0] == "deg"
    assert float(rows["pitch"][2]) == pytest.approx(5.0, rel=2e-3)  # the nearest sample
    assert rows["mooring_bow"][0] == "MN"
    assert float(rows["mooring_bow"][2]) == pytest.approx(3.5, rel=2e-3)
    # Windows stand 1 s apart, and two are missing.
    centre, lags = np.array([1.0, 2.0, 5.0, 6.0]), np.array([0.01, 0.02, 0.01, 0.02])
    found = Agreement(
        period=6.0, motion=0.7, step=np.nan, lag=0.015, lag_spread=0.005, growth=0.0,
        correlation=1.0, nrmse=0.0, gain=1.0, centre=centre, lags=lags,
    )  # fmt: skip
    top, pitch, line, lag = quality_figure(run, {"heave": found}).axes
    assert "[MN]" in line.get_ylabel()
    assert pitch.get_ylabel().endswith("[deg]")
    assert top.get_facecolor() != pitch.get_facecolor()  # it has a finding
    marks = next(line for line in top.lines if line.get_label() == "missing").get_ydata()
    np.testing.assert_allclose(marks, np.interp(time[40:45], time[[39, 45]], heave[[39, 45]]))
    line = lag.lines[0]
    assert list(np.isnan(line.get_ydata())) == [False, False, True, False, False]
    # The scale follows the harmful lag, a thirtieth of a period, and not the lags searched, a half.
    assert lag.get_ylim()[1] == pytest.approx(1.5 * LATE * found.period)


def test_prepare_writes_a_page_that_needs_nothing_else(tmp_path, command):
    for seed, name in enumerate(("first", "second")):
        columns = tank_columns(seed)
        columns["Heave [mm]"][400] += 500.0
        write_csv(tmp_path / f"{name}.csv", columns)
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(CAMPAIGN)
    assert "outlier: 1 samples" in command("prepare", campaign)[1]
    folder = tmp_path / "prepared"
    names = {p.name for p in folder.iterdir()}
    assert names == {"first.nc", "second.nc", "quality.html", "quality_first.png",
                     "quality_second.png"}  # fmt: skip
    page_of = folder / "quality.html"
    page = page_of.read_text("utf-8")
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    assert page.count("<img") == 2
    assert '<th class="number">findings</th>' in page  # heads stand over their numbers
    assert "outlier: 1 samples in 1 place(s)" in page
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    # What is unchanged is not made again; findings are printed with or without a sheet.
    for options in ([], ["--no-sheet"]):
        assert "outlier: 1 samples" in command("prepare", campaign, *options)[1]
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir()} == before
    (folder / "first.nc").touch()
    command("prepare", campaign)
    assert page_of.stat().st_mtime_ns > before[page_of]
    # Only the picture of the run that changed is drawn again.
    first, second = folder / "quality_first.png", folder / "quality_second.png"
    assert second.stat().st_mtime_ns == before[second]
    assert first.stat().st_mtime_ns > before[first]
