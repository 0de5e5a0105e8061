"""Whole records, and values that a vessel can reach: what prepare warns of and the sheet tells."""

import re
from contextlib import nullcontext

import numpy as np
import pytest
from said import data_error, findings, warned
from small_tank import campaign_of, tank_columns, write_csv
from tutorial_study import edit

from seakeep.campaign import draft_campaign, read_campaign
from seakeep.quality import findings_of

LOGGERS = """
[instruments]
reference = "probes"

[instruments.probes]

[instruments.mru]

[channels.eta_fwd]
column = "WP fwd"

[channels.heave]
column = "Heave"

[channels.pitch]
column = "Pitch"

[runs.first]
files = { probes = "probes.csv", mru = "mru.csv" }
train = [0, 10]
test = [10, 20]

[preparation]
sampling_rate = 10

[model]
states = ["heave", "pitch"]
inputs = ["eta_fwd"]
"""


CLOCKS = ("ASSUMED_CLOCK", "TIMES_ASIDE", "OTHER_RATE")
RECORDS = ("STARTS_LATE", "ENDS_EARLY")


def told(run, *kinds):
    return [(each.channel, each.text) for each in findings(run, *kinds)]


SPANS = "train = [0, 10]\ntest = [10, 20]"


@pytest.fixture
def loggers(tmp_path):
    """A run of two loggers; the motions' is written from one instant to another, both in s."""

    def write(begin=0.0, end=20.0, spans=SPANS):
        columns = tank_columns()
        time = columns["Time [s]"]
        write_csv(tmp_path / "probes.csv", {n: columns[n] for n in ("Time [s]", "WP fwd [mm]")})
        kept = (time >= begin) & (time <= end)
        rest = {n: x[kept] for n, x in columns.items() if n != "WP fwd [mm]"}
        write_csv(tmp_path / "mru.csv", rest)
        return campaign_of(tmp_path, LOGGERS.replace(SPANS, spans))

    return write


@pytest.mark.parametrize(
    ("spans", "shared"),
    [("train = [0, 10]\ntest = [10, inf]", (2.0, 18.0)), ("role = 'train'", (2.0, 18.0)),
     ("role = 'train'\nspan = [0, 2]", None)],
)  # fmt: skip
def test_runs_that_use_the_same_part_of_equal_files(changed, tank, spans, shared):
    """The test run, of 2 s to 18 s, is a copy of the other."""
    (tank / "second.csv").write_bytes((tank / "first.csv").read_bytes())
    campaign = changed(("train = [0, 10]\ntest = [10, inf]", spans))
    words = (
        r"^second: file is one of first too, and both use it from 2 s to 18 s\. Correct it in \["
    )
    with warned(words) if shared else nullcontext():
        runs = campaign.prepare()
    found = findings(runs["second"], "FILE")
    assert [(each.place, each.value) for each in found] == ([shared] if shared else [])


def test_a_logger_s_file_that_stands_in_two_runs(loggers, tmp_path):
    copied = '[runs.second]\nfiles = { probes = "probes_2.csv", mru = "mru.csv" }\n\n[preparation]'
    path = edit(loggers().path, ("[preparation]", copied))
    write_csv(
        tmp_path / "probes_2.csv", {n: tank_columns(1)[n] for n in ("Time [s]", "WP fwd [mm]")}
    )
    with warned("^second: file is one of first too"):
        assert "file" in kinds(read_campaign(path).prepare()["second"])


# What is assumed or contradicted about instants is a finding.


def test_clocks_of_which_nothing_is_said_are_assumed_the_same(loggers, tmp_path):
    campaign = loggers()
    found = told(campaign.prepare()["first"], *CLOCKS)
    assert [channel for channel, _ in found] == ["mru"]
    assert found[0][1].startswith("clock assumed the same as the reference's: state trigger")
    path = edit(campaign.path, ("[instruments.mru]", "[instruments.mru]\noffset = 0"))
    assert not told(read_campaign(path).prepare()["first"], *CLOCKS)


@pytest.mark.parametrize(
    ("files", "text"),
    {'time = "Time"\nsampling_rate = 100': "samples at 50 Hz, by its times; 100 Hz are",
     "sampling_rate = 25": "counted at the 25 Hz stated; the file's own times, which are ",
     'time = "Time"\nsampling_rate = 50': None, "sampling_rate = 50": None}.items(),
)  # fmt: skip
def test_a_rate_against_the_times(first, files, text):
    found = told(first(("[channels.eta_fwd]", f"[files]\n{files}\n\n[channels.eta_fwd]")), *CLOCKS)
    assert [each[0] for each in found] == ([] if text is None else ["time"])
    assert text is None or found[0][1].startswith(text)


@pytest.mark.parametrize(
    ("header", "files", "is_said"),
    [("Time", "", True), ("Sample", 'time = "Sample"', True), ("Time [s]", "", False),
     ("Time", 'time_unit = "s"', False)],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:.*shows waves of")  # at a step of 1 s they are too low
def test_times_that_may_count_samples(first, tank, header, files, is_said):
    columns = tank_columns()
    del columns["Time [s]"]
    write_csv(tank / "first.csv", {header: np.arange(1001.0)} | columns)
    stated = ("[channels.eta_fwd]", f"[files]\n{files}\n\n[channels.eta_fwd]")
    expected = warned(r"state sampling_rate \(Hz\) in \[files\]")
    with expected if is_said else nullcontext():
        run = first(stated, ("sampling_rate = 10", ""))
    assert ("counted" in kinds(run)) is is_said


@pytest.mark.filterwarnings("ignore:.*shows waves of")
def test_a_logger_whose_times_may_count_samples(loggers, tmp_path):
    path, columns = loggers().path, tank_columns()
    del columns["Time [s]"], columns["WP fwd [mm]"]
    edit(path, ("[instruments.mru]", "[instruments.mru]\noffset = 0"))
    write_csv(tmp_path / "mru.csv", {"Time": np.arange(1001.0)} | columns)
    with warned(r"mru counts 1, .* export its file without this column and state sampling_rate"):
        read_campaign(path).prepare()
    write_csv(tmp_path / "mru.csv", columns)
    edit(path, ("offset = 0", "offset = 0\nsampling_rate = 50"))
    assert "counted" not in kinds(read_campaign(path).prepare()["first"])


def test_a_motion_from_a_column_of_waves(first):
    with warned(
        r"heave is read from the column 'WP fwd', which is called as wave probes are\. "
        r"Correct column in \[channels\.heave\]"
    ):
        assert "wave column" in kinds(first(('column = "Heave"', 'column = "WP fwd"')))
    assert "wave column" not in kinds(first())


# A step that loses the waves, and one that is finer than what was recorded.


# Five waves of 0.5 to 0.9 Hz, all of one height, two of them above 0.72 Hz, where a filter for
# 1.6 Hz has its middle: 40 %, give or take how they beat under the spectrum's window.
@pytest.mark.parametrize(
    ("chain", "fate"),
    {"sampling_rate = 1.6": "[345]. % of the energy of its waves .* is damped or lost at 1.6",
     "sampling_rate = 1.5\nanti_alias = false": "0.75 Hz and is folded into slower waves",
     **dict.fromkeys(f"sampling_rate = {rate}" for rate in (10, 3, 100))}.items(),
)  # fmt: skip
def test_what_a_coarse_step_loses_is_told(first, chain, fate):
    found = dict(told(first(("sampling_rate = 10", chain)), "COARSE_STEP", "FINE_STEP"))
    assert set(found) == ({"eta_fwd", "heave", "pitch"} if fate else set())
    assert fate is None or re.search(fate, found["eta_fwd"])


def filtered(edges):
    return "sampling_rate = 10", f"sampling_rate = 10\nlow_pass = {edges}"


def test_a_low_pass_that_removes_the_waves_is_named(first):
    """Waves of 0.5 to 0.9 Hz: the first filter leaves all of them, the second none."""
    assert not kinds(first(filtered([2.0, 3.0])))
    with warned(
        r"loses (9\d.*|100) % of the energy of its waves .* to the filter low_pass, "
        r"which halves what lies at 0\.25 Hz .*\. Raise low_pass in \[preparation\]"
    ):
        assert "low pass" in kinds(first(filtered([0.17, 0.33])))


def test_a_low_pass_longer_than_the_record(first):
    """60 dB over 0.1 Hz take 41.8 s by Kaiser's formula, and the record has 20 s."""
    with data_error(r"'first': low_pass .* over 41\.8 s, .* lasts 20 s"):
        first(filtered([2.0, 2.1]))


@pytest.mark.parametrize(
    ("ends", "words", "span"),
    [((0.0, 15.0), "ends at 15 s, the other loggers at 20 s: the run is", (10.0, 15.0)),
     ((3.0, 20.0), "starts at 3 s, the other loggers at 0 s", (10.0, 20.0))],
)  # fmt: skip
def test_a_logger_that_was_cut_off_is_told(loggers, ends, words, span):
    with warned(f"first: mru {words}"):
        run = loggers(*ends).prepare()["first"]
    assert [text.startswith(words) for _, text in told(run, *RECORDS)] == [True]
    assert run.attrs["test_span"] == pytest.approx(span)


@pytest.mark.parametrize(
    ("ends", "spans"),
    [((0.5, 20.0), SPANS), ((0.0, 19.5), SPANS), ((5.0, 20.0), "span = [6, inf]"),
     ((0.0, 15.0), "train = [1, 8]\ntest = [8, 14]")],
)  # fmt: skip
def test_a_start_by_hand_and_what_the_run_does_not_use_do_no_harm(loggers, ends, spans):
    assert not told(loggers(*ends, spans).prepare()["first"], *RECORDS)


@pytest.mark.parametrize("test", ["[10, 20]", "[10, inf]"])
def test_a_test_part_without_samples_is_an_error(loggers, test):
    """It would else be judged on the part that trains."""
    campaign = loggers(end=8.0, spans=f"train = [0, 8]\ntest = {test}")
    with data_error(r"runs\.first\.test: \[10, .*holds 0 sample.* together only from 0 to 8 s"):
        campaign.prepare()


@pytest.mark.parametrize(
    ("role", "places"),
    [("span = [2, 13]", []), ("span = [0, 13]", [0.4]), ("span = [2, inf]", [13.8]),
     ("span = [14, inf]", [13.98])],
)  # fmt: skip
def test_faults_outside_the_span_are_none_of_the_run(changed, tank, role, places):
    """Outliers at 0.4 s, a pitch that sticks from 13.8 s on: seen from a sample before the span."""
    columns = tank_columns(1)
    columns["Heave [mm]"][20:22] = 900
    columns["Pitch (deg)"][690:] = columns["Pitch (deg)"][690]
    write_csv(tank / "second.csv", columns)
    run = changed(("span = [2, 18]", role)).prepare(["second"])["second"]
    assert [each.place for each in findings(run, "OUTLIERS", "STUCK")] == pytest.approx(places)


COUNTED = ("sampling_rate = 10", "steps_per_period = 12")


@pytest.mark.parametrize(  # mm, of 32; little noise is seen in a long record
    ("noise", "seconds", "part"), [(9.5, 20.0, 1.5), (1.6, 120.0, 1.05)]
)
def test_a_count_that_noise_leads_is_told(changed, tank, noise, seconds, part):
    sound = changed(COUNTED).encounter_period()
    for seed, name in enumerate(("first", "second")):
        columns = tank_columns(seed, seconds)
        noises = np.random.default_rng(seed).normal(0, noise, columns["Time [s]"].size)
        columns["WP fwd [mm]"] += noises
        write_csv(tank / f"{name}.csv", columns)
    with warned(
        r"first: eta_fwd counts waves of .* energy period of its spectrum is 1\.\d+ s"
        r"( \(second likewise\))?\. .*period_hysteresis"
    ):
        run = changed(COUNTED).prepare()["first"]
    assert run.attrs["encounter_period"] < sound / part
    assert [channel for channel, _ in told(run, "PERIOD")] == ["eta_fwd"]


@pytest.mark.parametrize(
    ("stem", "header", "message"),
    [("Pitch (deg)", "Pitch (rad)", r"pitch reaches \d.* deg, more than 90 deg"),
     ("Heave [mm]", "Heave [m]", r"heave leaves its mean by .* m in water of 3\.6 m"),
     ("WP fwd [mm]", "WP fwd [m]", r"eta_fwd leaves its mean by .* m in water of 3\.6 m")],
)  # fmt: skip
def test_values_that_nothing_afloat_reaches(changed, tank, stem, header, message):
    columns = tank_columns(0)
    write_csv(tank / "first.csv", {header if n == stem else n: x for n, x in columns.items()})
    with warned(message + r"\. Check unit and column in \[channe"):
        runs = changed().prepare()
    assert kinds(runs["first"]) & {"impossible", "out of water"}
    assert not kinds(runs["second"])


def test_a_unit_that_a_draft_assumed_is_told_until_it_is_confirmed(tank):
    columns = tank_columns(0)
    columns["pitch"] = np.radians(columns.pop("Pitch (deg)"))
    bare = write_csv(tank / "bare.csv", columns)
    campaign = campaign_of(tank, draft_campaign([bare], tank))
    with warned("pitch is taken as rad, .*remove unit_as"):
        run = campaign.prepare()["bare"]
    assert "unit" in kinds(run)
    edit(campaign.path, ("unit_assumed = true", ""))
    assert "unit" not in kinds(read_campaign(campaign.path).prepare()["bare"])


def kinds(run):
    return {each.kind.word for each in findings_of(run)}
