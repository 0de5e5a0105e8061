"""Verdicts on the paper's claims, from studies whose numbers are made up."""

import json
from math import tau

import numpy as np
import pytest
import xarray as xr
from cells import cells

from seakeep.report.acts import LOADS, REGULAR, Claims, Evidence
from seakeep.study import StudyResult
from seakeep.study.judge import MEASURES

NAMES = ["surge", "heave", *LOADS]
DT, SPLIT, SIZE = 0.1, 3.0, 4  # s, encounter periods of 1 s, training sets and windows
MODELS = ["deterministic", "bayesian", "fir"]
TIME = DT * np.arange(1, 241)
SHAPE = SIZE, TIME.size, len(NAMES)


def windows(changes, measured=None, judged=None):
    """A test set of windows of four runs; errors of .3, or as changed by what they are of.

    The keys of `changes` are words of model, measure and channel.
    """
    measured = np.ones(SHAPE) if measured is None else measured
    judged = np.ones((SIZE, SIZE), bool) if judged is None else judged
    error = 0.3 * np.ones((len(MODELS), len(MEASURES), SIZE, SIZE, len(NAMES)))
    forecast = np.broadcast_to(measured, (len(MODELS), SIZE, *measured.shape))
    test = cells(NAMES, TIME, MODELS, error=error, judged=judged, measured=measured, mean=forecast,
                 run=list("wxyz"), start=np.zeros(SIZE))  # fmt: skip
    named = {dim: test[dim].values for dim in ("model", "measure", "channel")}
    for words, value in changes.items():
        at = {dim: [w for w in words.split() if w in of] for dim, of in named.items()}
        test["error"].loc[{dim: of for dim, of in at.items() if of}] = value
    test["error"] *= 1 + 0.01 * np.random.default_rng(0).standard_normal(error.shape)
    return test.assign(noise_std=(("window", "channel"), np.full((SIZE, len(NAMES)), 0.1)))


def study(groups=None, **tests):
    """A result; its training sets are not in the order of their runs."""
    named = {name: windows({}) for name in ("irregular", *REGULAR)} | tests
    training = {"run": list("badc"), "stop": [10.0] * SIZE, "reads": [5.0] * SIZE}
    settings = {"statistics": {"split_period": SPLIT}, "tests": dict.fromkeys(named)}
    every = {
        "channels": xr.Dataset(coords={"channel": NAMES}),
        "training": xr.Dataset({key: ("training", value) for key, value in training.items()}),
        **{f"tests/{name}": test for name, test in named.items()},
        **(groups or {}),
    }
    attrs = {"settings": json.dumps(settings), "seed": 0, "dt": DT, "encounter_period": 1.0}
    return StudyResult(None, attrs, every)


def holds(claim, paper, raw=None):
    return Claims(paper, Evidence(raw or paper)).judge(claim)[1]


@pytest.mark.parametrize(
    ("change", "expected"), {0.0: True, 0.4: False, -0.4: False, 0.15: None}.items()
)
def test_errors_that_grow_or_fall_with_time_have_a_trend(change, expected):
    over = ("test", "band", "model")
    trend = xr.Dataset(
        {key: (over, np.full((1, 1, 3), change + apart))
         for key, apart in {"change": 0.0, "lower": -0.1, "upper": 0.1}.items()},
        coords={"test": ["irregular"], "band": ["all"], "model": MODELS},
    )  # fmt: skip
    assert holds("trend", study({"statistics/trend": trend})) is expected


@pytest.mark.parametrize(("lower", "expected"), [(0.9, True), (0.2, None)])
def test_loads_diverge_more_by_the_ends_of_both_intervals(lower, expected):
    """Ten times as much; at 0.2 its least value is 0.7 of the motions' largest."""
    numbers = {
        "mean": [0.1, 1.0],
        "lower": [0.05, lower],
        "upper": [0.2 if lower > 0.5 else 0.3, 2.0],
    }
    divergence = xr.Dataset(
        {
            key: (("model", "variant", "channel"), [[np.repeat(each, 2)]])
            for key, each in numbers.items()
        },
        coords={"model": ["bayesian"], "variant": ["paper"], "channel": NAMES},
    )
    assert holds("load_divergence", study({"statistics/divergence": divergence})) is expected


def test_the_slow_part_of_loads_is_judged_without_the_waves():
    fast, slow = np.sin(tau * TIME), np.sin(tau * TIME / 12)
    test = windows({}, np.broadcast_to((slow + 0.3 * fast)[:, None], SHAPE))
    for part, expected in ((slow - fast, True), (0.3 * fast - slow, False)):
        test["mean"] = test["mean"].dims, np.broadcast_to(part[:, None], test["mean"].shape)
        assert holds("slow_loads", study(irregular=test)) is expected


def slack_part(share):
    """Loads of which a share is slack."""
    measured = np.ones(SHAPE)
    measured[:, : round(share * TIME.size)] = 0.0
    return windows({}, measured)


@pytest.mark.parametrize(("stern", "expected"), [((0.9, 0.6, 0.3), True), ((0.3, 0.6, 0.9), False)])
def test_the_error_of_the_stern_line_falls_as_it_is_less_slack(stern, expected):
    paper = study(**{
        name: windows({"nrmse mooring_stern": error})
        for name, error in zip(REGULAR, stern, strict=True)
    })  # fmt: skip
    raw = study(**{
        name: slack_part(share) for name, share in zip(REGULAR, (0.6, 0.4, 0.2), strict=True)
    })  # fmt: skip
    assert holds("stern", paper, raw) is expected


@pytest.mark.parametrize(
    ("claim", "changes", "expected"),
    [
        ("who_errs", {"mooring_bow": 0.9}, True),
        ("who_errs", {"heave": 0.9}, False),
        ("peaks", {"nrmse mooring_bow mooring_stern": 3.0}, True),
        ("peaks", {"nammae mooring_bow mooring_stern": 3.0}, False),
        ("robust", {}, True),
        ("robust", {"bayesian": 0.7}, False),
        ("robust", {"fir": 0.7}, True),
        ("better", {"bayesian": 0.2}, True),
        ("better", {"deterministic": 0.2}, False),
        ("always_better", {"bayesian": 0.2}, True),
        ("regular", {"mooring_bow": 0.9}, True),
        ("regular", {"heave": 0.9}, False),
    ],
)
def test_errors_decide(claim, changes, expected):
    every = {name: windows(changes) for name in ("irregular", *REGULAR)}
    assert holds(claim, study(**every)) is expected


@pytest.mark.parametrize(("nrmse", "nammae", "expected"), [(0.6, 0.1, True), (0.1, 0.6, False)])
def test_regular_waves_are_compared_with_irregular_ones(nrmse, nammae, expected):
    regular = windows({"nrmse": nrmse, "nammae": nammae})
    assert holds("against_irregular", study(**dict.fromkeys(REGULAR, regular))) is expected


def test_cells_that_are_not_judged_stay_out_of_the_band():
    judged = np.ones((SIZE, SIZE), dtype=bool)
    judged[0] = False
    test = windows({}, np.random.default_rng(1).normal(0, 1, SHAPE), judged)
    edge = np.full((len(MODELS), SIZE, SIZE, TIME.size, len(NAMES)), 10.0)
    edge[:, 0] = 0.0  # of the set of training that is not judged
    bands = cells(NAMES, TIME, MODELS, lower=-edge, upper=edge)
    assert holds("load_band", study(irregular=test.merge(bands))) is False


@pytest.mark.parametrize(
    ("claim", "changes", "expected"),
    [
        ("stable", {}, True),
        ("stable", {"none": 0.9}, False),
        ("cheaper", {}, True),
        ("cheaper", {"truncated": 0.5}, False),
        ("robust_to_noise", {}, True),
        ("robust_to_noise", {"truncated": 0.2}, False),
    ],
)
def test_the_ridge_is_judged_against_none_and_truncation(claim, changes, expected):
    numbers = {"ridge": 0.9, "none": 1.1, "truncated": 2.0} | changes
    table = np.tile([[value] for value in numbers.values()], SIZE)
    cells = np.full((SIZE, SIZE, len(NAMES)), numbers["truncated"])
    group = xr.Dataset(
        dict.fromkeys(("radius", "seconds"), (("variant", "training"), table))
        | {
            "truncated_nrmse": (("training", "window", "channel"), cells),
            "rank": ("training", [9] * SIZE),
        },
        coords={"variant": list(numbers)},
    )
    assert holds(claim, study({"regularisation/deterministic": group})) is expected
