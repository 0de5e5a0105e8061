"""What a study file says, and where the study learns and tests: windows apart, several sets."""

from math import tau

import numpy as np
import pytest
import xarray as xr
from near import assert_near
from said import request_error

from seakeep.study import StudySettings, read_study
from seakeep.study.plan import Needs, choose_tests, choose_training, windows_overlap
from seakeep.toml import validated

DT = 0.1


def recorded(samples, *, waves="irregular", sea_state="", **spans):
    """A run as preparation leaves it: the windows look at its clock and its attributes alone."""
    return xr.Dataset(
        coords={"time": ("time", DT * np.arange(samples))},
        attrs={"dt": DT, "waves": waves, "sea_state": sea_state, **spans},
    )


def settings(**tables):
    content = {"study": {"campaign": "campaign.toml", "seed": 5}, **tables}
    return validated(StudySettings, content, "study.toml", "study")


@pytest.mark.parametrize(
    ("words", "tables"),
    {
        r"^study.toml: 2 mistakes(.|\n)*training.windows: received 0(.|\n)*length: received -1":
            {"training": {"windows": 0}, "tests": {"irregular": {"length": -1.0}}},
        "'windows' belongs to scheme = 'hal": {"training": {"scheme": "leave_out", "windows": 3}},
        "'leave_out' belongs to scheme = 'leave_out'": {"training": {"leave_out": "run"}},
        r"densities_of = 'regular' is not a table": {"statistics": {"densities_of": "regular"}},
        "the name 'a/b' must hold a letter or digit, and nothing beside": {"tests": {"a/b": {}}},
        "the name '_-' must hold a letter or digit": {"tests": {"_-": {}}},
        r"seed: received 18446.* below 2\^64": {"study": {"campaign": "c.toml", "seed": 2**64}},
    }.items(),
)  # fmt: skip
def test_what_no_study_file_may_say(tables, words):
    with request_error(words):
        settings(**tables)


def test_the_digest_follows_settings_and_raw_files_and_no_words(study_folder):
    path = study_folder / "study.toml"
    text = path.read_text("utf-8")

    def digest(seed="seed = 3", more=""):
        path.write_text(text.replace("seed = 3", seed) + more, "utf-8")
        return read_study(path).digest

    before = digest()
    assert digest('seed = 3\nname = "other"', "\n[output]\npaper = true\n") == before
    assert digest("seed = 4") != before
    with (study_folder / "run2.csv").open("a", encoding="utf-8") as file:
        file.write("\n")
    assert digest() != before


def test_overlap_of_windows_by_hand():
    # b is half covered by a, a is half covered by b, c lies in another run.
    spans = [("x", 0.0, 10.0), ("x", 5.0, 15.0), ("y", 0.0, 10.0)]
    # 200 cells a window: the share is exact to one cell.
    assert_near(windows_overlap(spans), 1 / 3, 0.005)


def samples_of(run, start, stop):
    time = run["time"].values
    return int(np.argmin(np.abs(time - start))), int(np.argmin(np.abs(time - stop)))


RUNS = {
    "a": recorded(1000, train_span=(10.0, 60.0), test_span=(60.1, 99.9)),
    "b": recorded(800, train_span=(0.0, 40.0), test_span=(40.1, 79.9)),
}
NEEDS = Needs(snapshots=120, history=30)


def training(runs=RUNS, inputs=(), **table):
    return choose_training(settings(training=table), runs, list(runs), NEEDS, inputs)


def learnt(found):
    return [tuple(run for run, *_ in each.spans) for each in found]


def left_out(found):
    return [each.left_out for each in found]


def windows_of(runs=RUNS, name="set", steps=50, sets=(), **table):
    return choose_tests(
        name,
        settings(tests={name: table}).tests[name],
        runs,
        list(runs),
        steps=steps,
        needs=NEEDS,
        whole=False,
        seed=5,
        training=sets,
    )


def test_training_windows_hold_the_largest_draw_with_its_history():
    for placement, windows in {"random": 6, "apart": None}.items():
        found = training(placement=placement, windows=windows)
        # 501 and 401 samples from the spans' ends back in steps of 120, as long as 150 remain.
        assert len(found) == 6
        for name, run in RUNS.items():
            spans = [each.spans[0][1:] for each in found if each.spans[0][0] == name]
            first, stop = run.attrs["train_span"]
            assert all(first <= begin and end <= stop for begin, end in spans)
            places = np.array([samples_of(run, *each) for each in spans])
            assert np.ptp(places, axis=1).min() >= NEEDS.snapshots + NEEDS.history - 1
            if placement == "apart":  # they share no snapshot
                assert len(spans) == 3
                assert np.diff(np.sort(places[:, 1])).min() >= NEEDS.snapshots


def test_random_training_windows_are_drawn_without_replacement_from_all_feasible_stops():
    # 352 and 252 stops are feasible; all of them are used when as many are asked for.
    assert len({each.spans for each in training(windows=352 + 252)}) == 604
    with request_error(r"605 windows were asked for and 604 are feasible"):
        training(windows=605)


def test_test_windows_apart_share_no_instant_and_all_that_fit_are_taken():
    found = windows_of(placement="apart", windows=None)
    for name, run in RUNS.items():
        ends = sorted(
            samples_of(run, w.start, w.start)[0] + w.steps for w in found if w.run == name
        )
        assert np.diff(ends).min() >= 50
        assert run["time"].values[ends[-1]] <= run.attrs["test_span"][1] + 1e-9
        assert all(w.start >= run.attrs["test_span"][0] - 1e-9 for w in found if w.run == name)
    # Test spans of 399 samples: seven windows of 50 instants with a start before each.
    assert len(found) == len(windows_of(placement="apart", windows=40)) == 14
    assert len(windows_of(placement="apart", windows=3)) == 3


def test_a_window_too_long_is_answered_with_the_longest_in_periods():
    # 500 instants are 15 periods, and a test span of 399 samples holds 398 after a start: 11.94.
    with request_error(r"\(length at most 11.9 periods\)"):
        windows_of(steps=500)


def test_the_start_up_of_a_test_span_is_cut_off():
    wave = {"wave": recorded(700, waves="regular", test_span=(0.0, 69.9))}
    found = windows_of(wave, windows=None, placement="random", startup=25.0)
    assert min(w.start for w in found) == pytest.approx(25.0)
    without = windows_of(wave, windows=None, placement="random")
    # What remains before the first start is the delay history.
    assert min(w.start for w in without) == pytest.approx(NEEDS.history * DT)
    with request_error(r"tests.set: no window is feasible.*start-up"):
        windows_of(wave, startup=66.0)


def test_each_group_that_is_left_out_has_a_window_and_windows_that_do_so_stay():
    runs = {name: recorded(3000, sea_state="A") for name in ("a1", "a2", "a3")}
    runs["b"] = recorded(150, sea_state="B")  # 2 % of all places
    sets = training(runs=runs, scheme="leave_out", leave_out="sea_state")
    drawn = windows_of(runs, sets=sets, windows=2)
    assert [each.run[0] for each in drawn] == ["a", "b"]
    assert {each.run for each in windows_of(runs, windows=4)} == set(runs)  # run by run
    # Of places in random order the first of each group goes first: more windows move none.
    assert {*drawn} < {*windows_of(runs, sets=sets, windows=12)}
    assert windows_of(runs, sets=sets, windows=400) == windows_of(runs, sets=(), windows=400)


def test_each_test_set_draws_from_a_stream_of_its_own():
    """So that a further set moves no window of another."""
    assert windows_of(name="regular", windows=4) != windows_of(name="irregular", windows=4)


def test_leaving_out_a_sea_state_leaves_out_all_of_its_runs():
    runs = {name: recorded(400, sea_state=name[0]) for name in ("a1", "a2", "b1")}
    runs["lone"] = recorded(400)
    found = training(runs=runs, scheme="leave_out", leave_out="sea_state")
    assert left_out(found) == [("a1", "a2"), ("b1",), ("lone",)]
    assert learnt(found) == [("b1", "lone"), ("a1", "a2", "lone"), ("a1", "a2", "b1")]


def test_a_run_tests_only_where_no_run_of_its_sea_state_trains():
    runs = {name: recorded(400, sea_state=name[0]) for name in ("a1", "b1", "a2", "c1")}
    table = settings(training={"scheme": "leave_out", "leave_out": "sea_state"})
    found = choose_training(table, runs, ["a1", "b1"], NEEDS, ())
    assert learnt(found) == [("b1",), ("a1",)]
    assert left_out(found) == [("a1", "a2"), ("b1",)]
    judged = [[run for run in runs if each.may_test(run)] for each in found]
    assert judged == [["a1", "a2", "c1"], ["b1", "c1"]]
    assert {each.run[0] for each in windows_of(runs, sets=found, windows=3)} == {*"abc"}


def test_an_irregular_run_that_tests_groups_no_regular_ones_that_train():
    runs, rng = {}, np.random.default_rng(0)
    for name, (period, height) in {
        "a": (1.5, 1),
        "b": (2, 1),
        "high": (1.5, 3),
        "sea": (1, 0),
    }.items():
        run = recorded(400, waves="irregular" if name == "sea" else "regular")
        waves = height * np.sin(tau * run["time"].values / period)
        waves += (name == "sea") * rng.standard_normal(400)
        runs[name] = run.assign(eta=("time", waves, {"units": "m"}))
    table = settings(training={"scheme": "leave_out"})
    found = choose_training(table, runs, ["a", "b"], NEEDS, ["eta"])
    assert left_out(found) == [("a", "high"), ("b",)]
    assert all(each.may_test("sea") for each in found)


def test_leaving_out_a_run_leaves_out_those_that_repeat_its_waves():
    """By what the first elevation among the inputs measured, whatever sea states are stated."""
    runs = {}
    for name, (period, late) in {"a": (1.5, 0.0), "b": (2.0, 0.0), "a_2": (1.5, 0.4)}.items():
        run = recorded(400, sea_state="same")
        waves = np.sin(tau * (run["time"].values - late) / period)
        wind = ("time", np.ones(400), {"units": "m/s"})
        runs[name] = run.assign(wind=wind, eta=("time", waves, {"units": "m"}))
    given = {"runs": runs, "inputs": ["wind", "eta"], "scheme": "leave_out"}
    assert left_out(training(**given)) == [("a", "a_2"), ("b",)]
    assert left_out(training(**given, leave_out="run")) == [("a",), ("b",), ("a_2",)]
    del runs["b"]
    with request_error("a run with its repetitions of a, a_2 leaves no run"):
        training(**given)
