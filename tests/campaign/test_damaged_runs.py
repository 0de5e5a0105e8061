"""A run that cannot be read keeps no other from its work, though clocks and periods pool all."""

import re

import pytest
import two_loggers
from said import data_error, findings, warned
from small_tank import DT, tank_columns, write_csv
from tutorial_study import edit

from seakeep import DataError, RequestError
from seakeep.campaign import load_prepared, read_campaign, write_prepared
from seakeep.signals import encounter_period

POOLED = ("sampling_rate = 10", "steps_per_period = 12")
CUT = b"Time [s],WP fwd [mm],Heave [mm],Pitch (deg),acc [g]\n0.0,1.0,2.0\n"
NOTE = (
    r"run 'second' is left out of the encounter period: .*second\.csv.*"
    r"Once it is repaired, prepare again; or state role = 'unused' in \[runs\.second\]"
)


@pytest.mark.parametrize("content", [CUT, b"", bytes(range(256)), None])
def test_the_others_are_prepared_without_it_and_anew_once_it_is_mended(changed, tank, content):
    campaign = changed(POOLED)
    damaged, kept = tank / "second.csv", tank / "prepared/first.nc"
    damaged.unlink() if content is None else damaged.write_bytes(content)
    with warned(NOTE):
        run = campaign.prepare(["first"])["first"]
    alone = encounter_period(1e-3 * tank_columns(0)["WP fwd [mm]"], DT)
    assert run.attrs["encounter_period"] == pytest.approx(alone, rel=1e-12)  # unit conversion
    told = findings(run, "LEFT_OUT")
    assert [(each.run, each.channel) for each in told] == [("second", "run second")]
    assert told[0].text.startswith("is left out of the encounter period: ")
    refused, written = RequestError if content is None else DataError, []
    # The others are kept, fresh as long as the damage is the same.
    for work in (write_prepared, load_prepared, write_prepared):
        with pytest.raises(refused, match=r"second\.csv"):
            work(campaign)
        written.append(kept.stat().st_mtime_ns)
    assert len(set(written)) == 1
    write_csv(damaged, tank_columns(1))
    write_prepared(campaign)
    assert kept.stat().st_mtime_ns > written[0]
    assert not findings(load_prepared(campaign)["first"], "LEFT_OUT")


@pytest.mark.usefixtures("empty_figures")
def test_the_commands(edited, tank, command):
    """prepare keeps what it can and ends with the error; fit and forecast of others run."""
    pytest.importorskip("matplotlib")
    path = edited(POOLED)
    (tank / "second.csv").write_bytes(CUT)
    out, told = command("prepare", path, status=1)
    assert "prepared/first.nc" in out
    assert "second.nc" not in out
    assert "second.csv" in told.split("Error:")[1]
    assert "Found in second: run second: is left out of the encounter period: " in told
    page = (tank / "prepared" / "quality.html").read_text("utf-8")
    assert re.search(r"<td>second</td><td[^>]*>not prepared</td>", page)
    assert "is left out of the encounter period" in page
    model = tank / "model.nc"
    (tank / "prepared" / "first.nc").unlink()
    assert "Note: run 'second' is left out" in command("fit", path, "-o", model)[1]
    words = ["forecast", model, path, "--start", 12, "--steps", 9, "-o", tank / "out.csv", "--run"]
    command(*words, "first")
    assert "second.csv" in command(*words, "second", status=1)[1]


def test_every_bad_file_is_named(changed, tank):
    campaign = changed()
    (tank / "first.csv").write_text("")
    (tank / "second.csv").write_bytes(CUT)
    with data_error(r"(?s)^2 runs cannot be read:\n'first': .*'second': "):
        write_prepared(campaign)
    campaign = changed(POOLED)
    with data_error(r"(?s)^2 runs cannot be read:\n'first': .*'second': "):
        campaign.encounter_period()


def test_pooled_drifts(tmp_path):
    path = edit(two_loggers.write(tmp_path), ("water_depth = 3.0", ""))  # places no probes
    for seed, name in enumerate(("two", "three"), 2):
        two_loggers.write_raw(tmp_path, name, seed)
        of_run = f"[runs.{name}.files]\nprobes = '{name}_probes.csv'\nmru = '{name}_mru.csv'\n"
        edit(path, ("[preparation]", f"{of_run}[preparation]"))
    campaign = read_campaign(path)
    whole = campaign.clocks()["one"]["mru"]
    (tmp_path / "three_mru.csv").write_text("t [s],heave\n0.0\n")
    with warned(r"run 'three' is left out of the pooled clock drifts: .*three_mru\.csv"):
        left = campaign.clocks(["one"])["one"]["mru"]
    assert "drift of 3 runs" in whole.describe()
    assert "drift of 2 runs" in left.describe()
    with warned("'three' is left out"):
        run = campaign.prepare(["one"])["one"]
    assert "is left out of the pooled clock drifts" in run.attrs["quality"]
    with data_error(r"three_mru\.csv"):
        campaign.clocks()
