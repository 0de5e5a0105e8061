"""The door of all public functions: arrays of real numbers, or a message of ours."""

import inspect

import numpy as np
import pytest
import xarray as xr
from array_calls import CALLS, TABLE, T, X

from seakeep import core, metrics, signals, statistics, waves
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
from seakeep.errors import DataError, RequestError, SeakeepError

# Of no array: settings, a file, Datasets, units, clocks, results of others.
WITHOUT_ARRAYS = {
    "signals.contact_sheet", "signals.froude_factor", "signals.lowpass_taps",
    "signals.pool_drift", "signals.track_video", "metrics.labelled", "metrics.anrmse_differences",
    "core.training_window", "statistics.overlap_block",
}  # fmt: skip
ROOMS = {
    "core": core,
    "signals": signals,
    "statistics": statistics,
    "metrics": metrics,
    "waves": waves,
}


def masked(x):
    mask = np.zeros(x.shape, dtype=bool)
    mask.flat[x.size // 3 : x.size // 3 + 5] = True
    return np.ma.MaskedArray(x, mask)


BAD = {
    "masked": masked,
    "complex": lambda x: x + 1j,
    "datetime64": lambda x: np.asarray(x * 1e3).astype("datetime64[ms]"),
    "timedelta64": lambda x: np.asarray(x * 1e3).astype("timedelta64[ms]"),
    "text": lambda x: x.astype(str),
    "a word": lambda x: "heave",
    "nothing": lambda x: None,
    "objects": lambda x: np.where(x > np.median(x), x.astype(object), None),
    "a Dataset": lambda x: xr.Dataset({"heave": ("time", x.ravel())}),
}
CASES = [
    pytest.param(name, place, id=f"{name}-{place}")
    for name, (_, *arguments) in CALLS.items()
    for place in range(len(arguments))
]


def test_every_public_function_is_in_the_list():
    functions = {
        f"{room}.{name}"
        for room, module in ROOMS.items()
        for name in module.__all__
        if inspect.isfunction(getattr(module, name))
    }
    assert functions == set(CALLS) | WITHOUT_ARRAYS


@pytest.mark.parametrize("name", CALLS)
def test_sound_arguments_pass(name):
    call, *arguments = CALLS[name]
    call(*arguments)


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize(("name", "place"), CASES)
def test_what_is_no_array_of_real_numbers_is_refused(name, place, kind):
    call, *arguments = CALLS[name]
    arguments[place] = BAD[kind](arguments[place])
    if kind == "a Dataset" and name == "statistics.moving_block_bootstrap":
        return
    with pytest.raises((SeakeepError, TypeError, ValueError)):
        call(*arguments)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (masked(X), r"x holds 5 masked value\(s\).* numpy\.ma\.filled"),
        ([masked(X), X], r"x holds 5 masked value\(s\)"),
        (X + 1j, r"x must be real numbers; received ndarray of type complex128. Give its real"),
        (T.astype("datetime64[s]"), r"type datetime64\[s\]. Give seconds: \(t - t\[0\]\)"),
        (["a", "b"], r"received list of type <U1. Convert the text to numbers"),
        ([1.0, None], r"type object. Convert every value to a number, gaps to NaN"),
    ],
)
def test_what_the_message_says(values, message):
    with pytest.raises(RequestError, match=message):
        as_real(values, "x")


def test_what_is_taken_as_it_is():
    np.testing.assert_array_equal(as_real(np.ma.MaskedArray(X), "x"), X)
    np.testing.assert_array_equal(as_real(xr.DataArray(X), "x"), X)
    np.testing.assert_array_equal(as_real([True, 2, np.float32(3)], "x"), [1, 2, 3])
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
        (lambda: number([1.0, 2.0], "x"), RequestError, "x must be a number"),
        (lambda: positive(0.0, "dt", "s"), RequestError, r"dt must be positive \(s\)"),
        (lambda: fraction(1.0, "level"), RequestError, "level must lie between 0 and 1"),
        (lambda: whole_number(2.0, "n"), RequestError, "n must be a whole number of at least 1"),
    ],
)
def test_single_numbers_and_shapes(call, error, message):
    with pytest.raises(error, match=message):
        call()
