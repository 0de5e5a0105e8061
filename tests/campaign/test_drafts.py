"""Drafts of campaign files: they must be read and prepared as they are."""

from math import tau

import numpy as np
import pytest
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose
from said import request_error
from scipy import io
from small_tank import campaign_of, tank_columns, write_csv

from seakeep import read_campaign
from seakeep.campaign import draft_campaign
from seakeep.campaign.guesses import suggest_channel


@pytest.fixture
def drafted(tmp_path):
    """Draft of files, or of one with the columns that are given: its text, and its campaign."""

    def draft(given):
        files = given if isinstance(given, list) else [write_csv(tmp_path / "run.csv", given)]
        text = draft_campaign(files, tmp_path)
        return text, campaign_of(tmp_path, text)

    return draft


def roles(campaign):
    return {name: run.role for name, run in campaign.settings.runs.items()}


def tank_file(folder, name, seed=0, size=1.0, slower=1.0):
    """Of a minute, larger and slower than the tank's."""
    columns = {key: size * each for key, each in tank_columns(seed, 60.0).items()}
    columns["Time [s]"] *= slower / size
    return write_csv(folder / f"{name}.csv", columns)


@pytest.fixture
def alike(tmp_path):
    """Files of three runs in the same sea."""
    return [tank_file(tmp_path, f"a{seed}", seed) for seed in range(3)]


GUESSES = {
    "": {
        ("HEAVE_CoG", "mm"): "heave",
        ("z", "m"): "heave",
        ("GyroPitch", "deg/s"): "pitch_rate",
        ("acc_z", "g"): "heave_acceleration",
        ("ACC_Heave_SB", "m/s2"): "acc_heave_sb",
        ("Heave", "deg"): "heave_signal",
        ("WP_1", "m"): "eta_1",
        ("eta cog", None): "eta_cog",
        ("eta_bow", "m"): "eta_bow",
        ("eta", "m"): "eta_1",
        ("Wave bow", "m"): "eta_1",
        ("WaveRadar Bow range", "m"): "wave_radar_bow_range",
        ("probe", "cm"): "eta_1",
        ("probe", "V"): "probe",
        ("Tension_SB", "N"): "mooring_starboard",
        ("Mooring aft", "N"): "mooring_stern",
        ("Line 3 load", "N"): "mooring_3",
        ("Force_Sway", "N"): "force_sway",
        ("FAIRTEN2", "N"): "mooring_2",
        ("Wind1VelX", "m/s"): "wind_1_vel_x",
        ("BldPitch1", "deg"): "bld_pitch_1",
        ("Current heave", "mm"): "heave",
        ("Roll wind on", "deg"): "roll",
        ("Ten 1", "N"): "ten_1",
        ("3rd thing", None): "column_3_rd_thing",
        ("Ærlig", None): "rlig",
        ("Time", "V"): "time_signal",
        ("heave flags", None): "heave",
        ("odd flags", None): "odd_flags_signal",
        ("°", None): "channel",
    },
    "wave_probes": {
        ("us_fwd", "mm"): "eta_us_fwd",
        ("air gap", "m"): "air_gap",
        ("carriage", "V"): "carriage",
    },
    "mru": {("us_fwd", "mm"): "us_fwd", ("rate_x", "deg/s"): "roll_rate"},
}
"""Channels by logger, column and unit."""


@pytest.mark.parametrize("logger", GUESSES)
def test_guesses(logger):
    for given, channel in GUESSES[logger].items():
        assert suggest_channel(*given, logger) == channel


def regular(folder, name, period, height=20, seed=0, begin=-20.0, rate=25):
    """A regular run as a tank records it: still water, waves at the probe, then at the vessel."""
    t = np.arange(0, 60, 1 / rate)
    rng = default_rng(seed)

    def wave(start, phase):
        ramp, angle = np.clip((t - start) / (2 * period), 0, 1), tau * (t - start) / period
        return ramp * (np.sin(angle + phase) + 0.1 * np.sin(2 * angle))

    response = 1 / (1 + (1.2 / period) ** 4)
    columns = {
        "WP fwd [mm]": height * wave(begin, 0.0),
        "Heave [mm]": height * response * wave(begin + 4, -response),
        "Pitch (deg)": 0.1 * height * response * wave(begin + 4, 1.5 - response),
    }
    noisy = {n: x + 0.01 * height * rng.normal(size=t.size) for n, x in columns.items()}
    return write_csv(folder / f"{name}.csv", {"Time [s]": t + 5} | noisy)


def test_the_step_suits_the_shortest_waves_of_all_runs(tmp_path, drafted):
    files = [regular(tmp_path, f"run{i}", T, rate=200) for i, T in enumerate((1.5, 0.6, 1.0))]
    still = {"Time [s]": np.arange(0, 40, 0.005)}
    random = default_rng(0)
    still |= {name: random.normal(0, 0.2, 8000) for name in ("WP fwd [mm]", "Heave [mm]")}
    files.append(write_csv(tmp_path / "still.csv", still))  # still water has no waves
    text, campaign = drafted(files)
    rate = campaign.settings.preparation.sampling_rate
    assert_allclose(rate, 200 / 3, rtol=1e-5)  # 40 samples in 0.6 s; each fourth made 30
    assert "# Hz; guessed: about 32 samples per wave of 0.6 s, the shortest" in text


def test_a_draft_asks_whether_slow_files_count_milliseconds(drafted):
    for rate, asks in ((50, False), (0.05, True)):
        count = np.arange(600)
        text, _ = drafted({"t": count / rate, "WP fwd [mm]": np.sin(tau * count / 30)})
        assert f"# the files have {rate} samples per second" in text
        assert ("time_unit = 'ms'" in text) is asks


@pytest.mark.parametrize("odd", [0, 2])
def test_one_file_in_milliseconds_is_drafted_as_such(tmp_path, drafted, odd):
    """Sampled as slowly as its times say in s, all runs would look like repeats of one sea."""
    files = []
    for seed in range(3):
        columns = tank_columns(seed, 60.0)
        columns = {"t": columns.pop("Time [s]") * (1000 if seed == odd else 1)} | columns
        files.append(write_csv(tmp_path / f"a{seed}.csv", columns))
    text, campaign = drafted(files)
    runs = campaign.settings.runs
    assert [run.time_unit for run in runs.values()] == [None] * odd + ["ms"] + [None] * (2 - odd)
    assert "sea_state = " not in text.replace("# sea_state", "")
    times = [run["time"].values[[0, -1]] for run in campaign.prepare().values()]
    assert_allclose(times, [times[0]] * 3)


@pytest.mark.parametrize("loggers", [1, 2])
def test_a_draft_tells_days_and_midnights(tmp_path, drafted, loggers):
    """The day begins before midnight; a logger beside counts seconds of day."""
    columns = tank_columns()
    t = 86390.0 + columns.pop("Time [s]")
    of_day = {"PLC time": np.round(t % 86400, 3), "load [N]": np.cos(t)}
    mru = write_csv(tmp_path / "mru.csv", {"Time": 45415 + t / 86400, **columns})
    text, campaign = drafted([mru, write_csv(tmp_path / "plc.csv", of_day)][:loggers])
    settings = campaign.settings
    own = settings.instruments["mru"] if loggers > 1 else settings.files
    assert own.time_unit == "d"
    assert text.count("time_unit") == 1
    assert text.count(" 50 samples per second") == loggers
    assert campaign.prepare()


@pytest.mark.parametrize(
    ("header", "factor"), [("t_DAQ", 1), ("QTM_time", 1), ("DAQ time_ms", 1e3)]
)
def test_times_that_jitter_are_told_by_a_word_of_their_name(drafted, header, factor):
    """A carriage that moves evenly before them in the file is none."""
    columns = tank_columns()
    even = columns.pop("Time [s]")
    jitter = default_rng(0).uniform(-0.004, 0.004, even.size)
    text, campaign = drafted({"carriage": 1.5 * even, header: factor * (even + jitter)} | columns)
    assert campaign.settings.files.time == header
    assert campaign.settings.files.sampling_rate is None
    assert "# the files have 50.0" in text


def test_a_draft_of_structs_says_how_to_save_them(tmp_path):
    t = 0.02 * np.arange(1000)
    io.savemat(tmp_path / "run.mat", {"time": t, "waves": {"eta": t}, "motion": {"heave": t}})
    with request_error(r"'waves' is a struct .*\. Save .* one struct of vectors"):
        draft_campaign([tmp_path / "run.mat"])


def test_a_draft_without_waves_says_so(tmp_path, drafted):
    path = regular(tmp_path, "a", 1.6)
    path.write_text(path.read_text("utf-8").replace("WP fwd", "CH7"), "utf-8")
    text, _ = drafted([path])
    assert "inputs = [] # CORRECT IT: no name tells the waves" in text


def test_motions_are_the_states_and_loads_are_named_beside_them(drafted):
    columns = tank_columns()
    columns["Tension_SB [N]"] = columns["Heave [mm]"]
    columns["Acc z [g]"] = columns.pop("acc [g]")
    text, campaign = drafted(columns)
    assert campaign.model().states == ("heave", "pitch")
    assert campaign.model().preset == "recommended"
    assert "# Loads (mooring_starboard) may be added to the states" in text
    only = {k: v for k, v in columns.items() if k.split()[0] in ("Time", "WP", "Acc", "Tension_SB")}
    _, campaign = drafted(only)
    assert campaign.model().states == ("heave_acceleration",)
    only.pop("Acc z [g]")
    _, campaign = drafted(only)
    assert campaign.model().states == ("mooring_starboard",)


def loggers(folder, run, seed, pattern):
    """Files of two loggers of a run, with a trigger; a probe has a gap, a clock is 0.5 s late."""
    columns = tank_columns(seed)
    time = columns["Time [s]"]

    def pulses(t):
        return np.where(np.modf(t / 4.0)[0] < 0.05, 5.0, 0.0)

    waves = {"t [s]": time, "trig [V]": pulses(time), "us 1 [mm]": columns["WP fwd [mm]"].copy(),
             "us 2 [mm]": columns["WP fwd [mm]"]}  # fmt: skip
    waves["us 1 [mm]"][100:105] = np.nan
    vessel = {"t [s]": time, "trig [V]": pulses(time + 0.5), "z [mm]": columns["Heave [mm]"],
              "rate y [deg/s]": columns["Pitch (deg)"]}  # fmt: skip
    out = []
    for logger, content in (("wave_probes", waves), ("mru", vessel)):
        path = folder / pattern.format(run=run, logger=logger)
        path.parent.mkdir(parents=True, exist_ok=True)
        out.append(write_csv(path, content))
    return out


@pytest.mark.parametrize(
    "pattern", ["{run}/{logger}.csv", "{run}/{run}_{logger}.csv", "{run}_{logger}.csv"]
)
@pytest.mark.parametrize("runs", [("a1", "b2", "regular_3"), ("a1",)])
def test_files_of_several_loggers(tmp_path, drafted, pattern, runs):
    if len(runs) == 1 and pattern == "{run}_{logger}.csv":
        runs = ("a1", "a2")
    files = [f for i, run in enumerate(runs) for f in loggers(tmp_path, run, i, pattern)]
    text, campaign = drafted(files)
    assert campaign.runs == list(runs)
    assert set(campaign.files_of("a1")) == {"wave_probes", "mru"}
    assert list(campaign.settings.channels) == ["eta_us_1", "eta_us_2", "heave", "pitch_rate"]
    assert campaign.model().inputs == ("eta_us_2",)  # the other one has gaps
    assert campaign.model().states == ("heave", "pitch_rate")
    assert campaign.settings.preparation.gaps == "bridge"
    assert campaign.settings.instruments.reference == "wave_probes"
    assert ('waves = "regular" # guessed' in text) is ("regular_3" in runs)
    assert ("guessed: loggers of one run" in text) is (len(runs) == 1)
    # Half of a sample: the pulses' edges lie between samples.
    assert_near(abs(campaign.prepare()["a1"].attrs["clock_mru_offset"]), 0.5, 0.01)


def test_a_draft_of_measurements_at_sea(tmp_path, drafted):
    """Of the logger of the wind none asks for the rate of the others."""
    columns = {"radar": ("BOW_AIRGAP [m]", 5), "mru": ("MRU1.Heave (down) [m]", 10),
               "met": ("Wind speed [kn]", 1)}  # fmt: skip
    files = []
    for logger, (column, rate) in columns.items():
        t = np.arange(0, 100, 1 / rate)
        files.append(write_csv(tmp_path / f"{logger}.csv", {"t [s]": t, column: np.cos(t)}))
    text, campaign = drafted(files)
    assert campaign.settings.preparation.sampling_rate == 5.0
    signs = {name: each.sign for name, each in campaign.settings.channels.items()}
    assert signs == {"bow_airgap": 1, "heave": -1, "wind_speed": 1}
    assert text.count("# a range down to the waves? Then sign = -1") == 1
    (run,) = campaign.prepare().values()
    assert_near(run["heave"], -np.cos(run["time"]), 1e-3)  # resampled


@pytest.mark.parametrize("pattern", ["{run}/{logger}.csv", "{run}_{logger}.csv"])
def test_files_that_fit_no_run_or_logger_are_named(tmp_path, drafted, pattern):
    files = [f for i, run in enumerate(("a1", "a2")) for f in loggers(tmp_path, run, i, pattern)]
    again = files[-1].with_name(files[-1].name.replace("mru", "mru_sorted"))
    again.write_bytes(files[-1].read_bytes())
    if "/" in pattern:
        with request_error("a2/mru.csv and .*a2/mru_sorted.csv are of one run and have the same"):
            drafted([*files, again])
    write_csv(files[-1], {"t": np.arange(99.0), "Line [N]": np.cos(np.arange(99.0))})
    with request_error("a1.mru.csv and .*a2.mru.csv are called as those of one logger"):
        drafted(files)
    if "/" in pattern:
        with request_error("a1/wave_probes.csv and .*a2/mru.csv have no column in common"):
            drafted([files[0], files[-1]])


@pytest.mark.parametrize("lost", [20, 200])  # of 1001 samples: a channel with gaps, and none
def test_what_has_long_gaps_is_left_out_with_a_word(drafted, lost):
    columns = tank_columns() | {"WP 2 [mm]": tank_columns()["WP fwd [mm]"]}
    for name in ("Heave [mm]", "WP 2 [mm]"):
        columns[name] = np.where(np.arange(1001) // lost == 3, np.nan, columns[name])
    text, campaign = drafted(columns)
    assert (campaign.model().states, campaign.model().inputs) == (("pitch",), ("eta_fwd",))
    assert 'column = "acc" # NOT RECOGNISED: rename the channel if it is a motion or load' in text
    assert text.count("NOT RECOGNISED") == 1
    if lost == 200:
        assert "# column 'Heave [mm]' left out: has gaps in run.csv" in text
        return
    for name, key in (("heave", "states"), ("eta_2", "inputs")):
        said = f"# {name} left out: it has gaps, and a model takes none. To be among the {key}, "
        assert said in text


def test_runs_have_the_role_that_their_waves_give_them(tmp_path, drafted, alike):
    """Regular and still runs are recognised; the last file is no test for being the last."""
    still = tank_file(tmp_path, "c_decay", 9, 1e-3)
    text, campaign = drafted([*alike, regular(tmp_path, "b0", 1.5), still])
    runs = campaign.settings.runs
    assert [runs[n].waves for n in ("a0", "b0", "c_decay")] == ["irregular", "regular", None]
    assert roles(campaign) == {
        "a0": "train", "a1": "train", "a2": "test", "b0": "test", "c_decay": "unused"
    }  # fmt: skip
    assert 'waves = "regular" # guessed from its spectrum' in text
    assert 'role = "unused" # guessed: no waves were found, as in still water, decay tests' in text
    text, _ = drafted([alike[0], still])
    assert 'role = "train" # the only run to train on\n' in text


def test_one_file_of_full_scale_is_named_and_spoils_no_other(tmp_path, drafted, alike):
    """What a decay radiates is less steep than the waves, so they are not the odd ones."""
    text, campaign = drafted([*alike, tank_file(tmp_path, "full", 1, 49.0, 7.0)])
    assert roles(campaign) == {"a0": "train", "a1": "train", "a2": "test", "full": "unused"}
    assert campaign.settings.runs["a0"].waves == "irregular"
    assert 'role = "unused" # guessed: its waves are 49 times those of the others (median)' in text
    quiet = [tank_file(tmp_path, f"decay{seed}", seed, 0.02) for seed in range(3)]
    _, campaign = drafted([alike[0], *quiet])
    assert [*roles(campaign).values()] == ["train", *3 * ["unused"]]


@pytest.mark.parametrize(
    ("dead", "beside"),
    [("constant", True), ("noise", True), ("hum", True), ("constant", False), ("noise", False)],
)
def test_a_dead_probe_shows_no_waves_and_drives_nothing(drafted, dead, beside):
    """Mains hum of 50 Hz at 50 samples per second is as slow as a wave."""
    columns = tank_columns(0, 60.0)
    t, heave = columns["Time [s]"], columns["Heave [mm]"]
    series = {"constant": 0 * t + 3, "noise": default_rng(0).normal(0, 0.2, t.size),
              "hum": 0.2 * np.sin(tau * 50.3 * t)}  # fmt: skip
    waves = {"WP 1 [mm]": series[dead]} | ({"WP 2 [mm]": columns["WP fwd [mm]"]} if beside else {})
    text, campaign = drafted({"Time [s]": t, **waves, "Heave [mm]": heave})
    assert campaign.settings.runs["run"].waves == ("irregular" if beside else None)
    assert campaign.model().inputs == (("eta_2",) if beside else ("eta_1",))
    assert ("# eta_1 left out: next to no motion beside the others" in text) is beside
    assert ("STATE IT: no wave was found" in text) is not beside


def test_the_draft_of_regular_waves_holds_out_what_the_others_surround(tmp_path, drafted):
    """Neither the shortest nor the longest, nor a repeated one; from when the waves have come."""
    series = {"a": (1.0, 20), "b": (1.2, 24), "b_2": (1.2, 24), "c": (1.35, 22), "d": (1.5, 24),
              "d_2": (1.5, 24), "d_high": (1.5, 36), "e": (1.9, 20)}  # fmt: skip
    files = [
        regular(tmp_path, name, *of, seed, 12.0 + seed / 10)
        for seed, (name, of) in enumerate(series.items())
    ]
    text, campaign = drafted(files)
    runs = campaign.settings.runs
    assert campaign.test_runs == ["c"]
    why = "guessed: one run whose waves lie within those of the others tests, these train"
    assert f'role = "test" # {why}\n' in text
    # The waves reach the vessel at 5 + 12.3 + 4 s, to grow for two periods.
    assert 21.3 < runs["c"].span[0] < 21.3 + 3 * 1.35
    assert {name: run.sea_state for name, run in runs.items() if run.sea_state} == {
        "b": "waves of b", "b_2": "waves of b", "d": "waves of d", "d_2": "waves of d"
    }  # fmt: skip
    assert text.count("# guessed: the same waves come again\n") == 4
    text, _ = drafted([files[0], files[4]])
    assert "# guessed: no waves lie within those of the others; the nearest run tests" in text


def test_a_unit_that_some_files_state_is_that_of_all(tmp_path, drafted):
    """Where they disagree, each keeps its own."""
    rest = tank_columns(0, 60.0)
    heave = rest.pop("Heave [mm]")
    silent = write_csv(tmp_path / "silent.csv", rest | {"Heave": heave})
    said = [tank_file(tmp_path, f"said{seed}", seed) for seed in range(2)]
    text, campaign = drafted([silent, *said])
    assert 'unit = "mm" # guessed: some files say it, the others state none.' in text
    assert text.count("\nunit = ") == 1
    runs = campaign.prepare()
    np.testing.assert_array_equal(runs["silent"]["heave"], runs["said0"]["heave"])
    other = write_csv(tmp_path / "other.csv", rest | {"Heave [cm]": heave / 10})
    text, _ = drafted([silent, *said, other])
    assert "\nunit = " not in text


def test_init_keeps_how_files_are_read(tmp_path, command):
    """A title with blanks, a blank line, tabs, decimal commas, a row of units."""
    path = tmp_path / "de.txt"
    rows = [f"{i / 50:.4f}\t{np.sin(i / 9):.4f}".replace(".", ",") for i in range(200)]
    head = ["Messung Schlepptank BM-7", "", "Zeit\tWelle_1", "s\tcm"]
    path.write_text("\n".join([*head, *rows, ""]), "utf-8")
    assert 'column = "Welle_1"' in command("init", path)[0]
    out = tmp_path / "campaign.toml"
    options = ["--skip-rows", "2", "--delimiter", "tab", "--decimal", ","]
    for status, more in ((0, []), (2, []), (0, ["--force"])):  # then it is there
        command("init", path, *options, "-o", out, *more, status=status)
    files = read_campaign(out).settings.files
    assert (files.skip_rows, files.delimiter, files.decimal) == (2, "\t", ",")
    run = read_campaign(out).read_run("de")
    assert_near(run["welle_1"][:3], np.sin(np.arange(3) / 9) / 100, 1e-6)
