"""The door of all public functions: arrays of real numbers, or a message of ours."""

import inspect

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_array_equal
from said import request_error

from seakeep import DataError, RequestError, SeakeepError, core, metrics, signals, statistics, waves
from seakeep.arrays import (
    as_bundle,
    as_pair,
    as_real,
    as_series,
    fraction,
    number,
    positive,
    whole_number,
)

T = np.arange(0, 60, 0.05)
X, Y = (np.sin(2.0 * t) + 0.3 * np.sin(3.1 * t + 1.0) for t in (T, T - 0.3))
NOISE = np.random.default_rng(0).standard_normal(T.size)
VECTORS = 0.1 * np.stack([X, Y, X], axis=1)
TABLE = np.stack([X, Y], axis=1)
PULSES = np.where(T % 10 < 0.5, 1.0, 0.0)
SOUND = {
    name: value
    for names, value in {
        "series first upstream test values": X,
        "complementary_filter.position jsd_interval.predicted": X,
        "reference second downstream": Y,
        "complementary_filter.acceleration jsd_interval.measured": Y,
        "p q frequency": np.abs(X),
        "time reference_time": T,
        "new_time": T[10:-10] + 0.01,
        "trigger reference_trigger": PULSES,
        "training": [X],
        "elevations records": {"a": X, "b": Y},
        "positions": {"a": 0.0, "b": 1.0},
        "angles rates position velocity acceleration": VECTORS,
        "angular_acceleration specific_force": VECTORS,
        "offset": np.ones(3),
        "predicted measured split_bands.series": TABLE,
        "lower": TABLE - 1,
        "upper": TABLE + 1,
        "density_grid.series": TABLE.T,
        "scores cells": TABLE[None, :9],
        "grid": np.linspace(-3, 3, 50),
        "block_length.series": NOISE,
        "A B": np.full((1, 2), 0.3),
        "histories": np.ones((3, 2)),
        "inputs": np.ones((3, 9, 2)),
        "wavelength": 1 + np.abs(X),
        "dt": 0.05,
        "crossover split_bands.frequency": 0.2,
        "separation stated": 1.2,
        "depth celerity": 3.0,
        "passband window largest_lag longest": 2.0,
        "band bounds distances": (0.1, 2.0),
        "count": 20,
        "block_length n_series": 9,
        "rng": np.random.default_rng(0),
        "statistic": lambda x: x.mean(axis=(1, 2)),
    }.items()
    for name in names.split()
}
"""Sound arguments by the name of the parameter, or of function and parameter."""
ROOMS = {core.rollout, *(
    getattr(room, name) for room in (signals, statistics, metrics, waves) for name in room.__all__
)}  # fmt: skip
# Of no array: files, Datasets, units, clocks, results of others.
OTHERS = {"contact_sheet", "froude_factor", "lowpass_taps", "pool_drift", "track_video", "labelled",
          "anrmse_differences", "overlap_block"}  # fmt: skip
FUNCTIONS = {
    each.__name__: each
    for each in ROOMS
    if inspect.isfunction(each) and each.__name__ not in OTHERS
}


def called(name, values):
    """Call a function; a variable number of arrays is one array of them."""
    bound = inspect.signature(FUNCTIONS[name]).bind_partial()
    bound.arguments |= values
    return FUNCTIONS[name](*bound.args, **bound.kwargs)


def masked(x):
    return np.ma.MaskedArray(x, np.arange(x.size).reshape(x.shape) == x.size // 2)


BAD = {
    "masked": masked,
    "complex": lambda x: x + 1j,
    "datetime64": lambda x: np.asarray(x * 1e3).astype("datetime64[ms]"),
    "timedelta64": lambda x: np.asarray(x * 1e3).astype("timedelta64[ms]"),
    "text": lambda x: x.astype(str),
    "a word": lambda x: "heave",
    "nothing": lambda x: [None],
    "objects": lambda x: np.where(x > np.median(x), x.astype(object), None),
    "a Dataset": lambda x: xr.Dataset({"heave": ("time", x.ravel())}),
}


def test_every_public_function_shows_the_type_of_each_argument():
    for name, function in FUNCTIONS.items():
        shown = inspect.signature(function).parameters
        assert [each for each in shown.values() if each.annotation is each.empty] == [], name
        # By the name of its type, which NumPy's types of arrays lose in hundreds of characters.
        assert "numpy._typing" not in f"{shown}", name


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_sound_arguments_pass_and_what_is_no_array_of_real_numbers_is_refused(name):
    wanted = [
        each
        for each in inspect.signature(FUNCTIONS[name]).parameters.values()
        if each.default is each.empty
    ]
    sound = {each.name: SOUND.get(f"{name}.{each.name}", SOUND.get(each.name)) for each in wanted}
    called(name, sound)
    for each in wanted:
        for kind, spoil in BAD.items() if each.annotation.endswith("ArrayLike") else ():
            if not (kind == "a Dataset" and name == "moving_block_bootstrap"):
                with pytest.raises(SeakeepError):
                    called(name, sound | {each.name: spoil(np.asarray(sound[each.name]))})


@pytest.mark.parametrize(
    ("message", "values"),
    {
        r"x holds 1 masked value\(s\).* numpy\.ma\.filled": masked(X),
        r"x holds 1 masked value\(s\)": [masked(X), X],
        r"x must be real numbers; received ndarray of type complex128. Give its real": X + 1j,
        r"type datetime64\[s\]. Give seconds: \(t - t\[0\]\)": T.astype("datetime64[s]"),
        r"received list of type <U1. Convert the text to numbers": ["a", "b"],
        r"x must be one array .*; received Dataset. Give a channel": xr.Dataset({"heave": 1.0}),
        "received list. Give .*rows of one length": [[1.0], [1.0, 2.0]],
        r"type object. Convert every value to a number, gaps to NaN": [1.0, None],
    }.items(),
)
def test_what_the_message_says(values, message):
    with request_error(message):
        as_real(values, "x")


def test_what_is_taken_as_it_is():
    assert_array_equal(as_real(np.ma.MaskedArray(X), "x"), X)
    assert_array_equal(as_real(xr.DataArray(X), "x"), X)
    assert_array_equal(as_real([True, 2, np.float32(3)], "x"), [1, 2, 3])
    assert as_real(X, "x") is X


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: as_series(3.0), RequestError, r"shape \(\); expected \(time,\)"),
        (lambda: as_pair([1, 2], [1, 2, 3]), RequestError, r"same length .* \(2,\) and \(3,\)"),
        (lambda: as_pair([1, 2], [3, 3], moving=True), DataError, r"second record is constant \(3"),
        (lambda: as_series([1.0]), DataError, r"has 1 sample\(s\); at least 2 are needed"),
        (lambda: as_series([1.0, np.inf]), DataError, "1 value.*, of 2, the first at sample 1"),
        (lambda: as_bundle(TABLE[None]), RequestError, r"expected \(time,\) or \(series, time\)"),
        (lambda: number("3", "x"), RequestError, "x must be a number; received '3'"),
        (lambda: number(np.ma.masked, "x"), RequestError, "x must be a number"),
        (lambda: positive(0.0, "dt", "s"), RequestError, r"dt must be positive \(s\)"),
        (lambda: fraction(1.0, "level"), RequestError, "level must be between 0 and 1"),
        (lambda: whole_number(2.0, "n"), RequestError, "n must be an integer of at least 1"),
    ],
)
def test_single_numbers_and_shapes(call, error, message):
    with pytest.raises(error, match=message):
        call()
