"""Expressions of channels: what they mean, and what they refuse."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from said import request_error

from seakeep.signals.expressions import parse

A, B = np.array([1.0, 2.0, 6.0]), np.array([4.0, -1.0, 0.5])


@pytest.mark.parametrize(
    ("text", "expected"),
    {
        "0.5*(a + b)": 0.5 * (A + B),
        "-a - -b": -A + B,
        "a - b / 2 * 3": A - B / 2 * 3,
        "a ** 0.5 + b ** -2": A**0.5 + B**-2,
        "-a**2": -(A**2),
        "square(a) + abs(b) + sqrt(a) + sin(a) * cos(b)":
            A**2 + abs(B) + np.sqrt(A) + np.sin(A) * np.cos(B),
        "a - mean(a)": A - 3.0,
        "average(a, b, a + b)": 2 * (A + B) / 3,
        "\n  1e-3 * a +\n 2\n": 1e-3 * A + 2,
    }.items(),
)  # fmt: skip
def test_values(text, expected):
    # Sums in one order or another: rounding.
    assert_allclose(parse(text).evaluate({"a": A, "b": B}), expected, rtol=1e-14)


def test_names_between_backticks():
    expression = parse("2 * `WP 1 [m]` - `μ` / x")
    assert expression.channels == ("WP 1 [m]", "μ", "x")
    assert_array_equal(expression.evaluate({"WP 1 [m]": A, "μ": B, "x": A}), 2 * A - B / A)


@pytest.mark.parametrize(
    ("text", "position", "what"),
    [
        ("a + __import__('os')", 5, "'__import__' is not a known function"),
        ("a + b[0]", 5, "'b[0]' is none of the allowed forms"),
        ("a + (lambda: 0)()", 5, "'(lambda: 0)()' is none of the allowed forms"),
        ("a + 'text'", 5, "\"'text'\" is none of the allowed forms"),
        ("a // 2", 1, "'a // 2' is none of the allowed forms"),
        ("a + sqare(b)", 5, "'sqare' is not a known function. Did you mean 'square'?"),
        ("`wave 1` + sqrt(a, b)", 12, "'sqrt' takes one argument(s), not 2"),
        ("a + average()", 5, "'average' takes one or more argument(s), not 0"),
        ("a + mean(a, b)", 5, "'mean' is the mean of one channel over time; the average of"),
        ("9**9**9 * a", 1, "an exponent is a number from -16 to 16"),
        ("a ** b", 1, "an exponent is a number from -16 to 16"),
        ("a ** -17", 1, "an exponent is a number from -16 to 16"),
        ("sqrt(a, axis=0)", 1, "'sqrt(a, axis=0)' is none of the allowed forms"),
        ("`wave 1`.x + a", 1, "'`wave 1`.x' is none of the allowed forms"),
        ("a b", 3, "this is not an arithmetic expression"),
    ],
)
def test_refused(text, position, what):
    words = re.escape(f"is not allowed: at character {position}, {what}")
    with request_error(f"{words}.*Allowed are numbers, channel names"):
        parse(text)
