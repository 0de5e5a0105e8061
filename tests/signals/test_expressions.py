"""Expressions of channels: what they mean, and what they refuse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seakeep.errors import DataError, RequestError
from seakeep.signals.expressions import parse

A, B = np.array([1.0, 2.0, 6.0]), np.array([4.0, -1.0, 0.5])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a", A),
        ("0.5*(a + b)", 0.5 * (A + B)),
        ("-a - -b", -A + B),
        ("a - b / 2 * 3", A - B / 2 * 3),
        ("a ** 0.5 + b ** -2", A**0.5 + B**-2),
        ("-a**2", -(A**2)),
        ("square(a) + abs(b) + sqrt(a) + sin(a) * cos(b)",
         A**2 + abs(B) + np.sqrt(A) + np.sin(A) * np.cos(B)),
        ("average(a, b)", (A + B) / 2),
        ("mean(a)", np.full(3, 3.0)),
        ("a - mean(a)", A - 3.0),
        ("average(a, b, a + b)", 2 * (A + B) / 3),
        ("\n  1e-3 * a +\n 2\n", 1e-3 * A + 2),
    ],
)  # fmt: skip
def test_values(text, expected):
    # Sums in one order or another: rounding.
    np.testing.assert_allclose(parse(text).evaluate({"a": A, "b": B}), expected, rtol=1e-14)


def test_names_between_backticks():
    expression = parse("2 * `WP 1 [m]` - `μ` / x")
    assert expression.channels == ("WP 1 [m]", "μ", "x")
    values = {"WP 1 [m]": A, "μ": B, "x": A}
    np.testing.assert_array_equal(expression.evaluate(values), 2 * A - B / A)


def test_frozen_and_comparable():
    assert parse("a + b") == parse("a + b")
    assert parse("b*a*b").channels == ("b", "a")
    with pytest.raises(AttributeError):
        parse("a").text = "b"


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_as_python_would_reckon(x, y, z):
    text = f"({x!r}) * a - ({y!r}) * (b + ({z!r}))"
    expected = x * A - y * (B + z)
    np.testing.assert_array_equal(parse(text).evaluate({"a": A, "b": B}), expected)


@pytest.mark.parametrize(
    ("text", "position", "what"),
    [
        ("a + __import__('os')", 5, "'__import__' is not a known function"),
        ("a.real", 1, "'a.real' is none of the allowed forms"),
        ("a + b[0]", 5, "'b[0]' is none of the allowed forms"),
        ("a if b else a", 1, "'a if b else a' is none of the allowed forms"),
        ("a + (lambda: 0)()", 5, "'(lambda: 0)()' is none of the allowed forms"),
        ("a + [x for x in b]", 5, "'[x for x in b]' is none of the allowed forms"),
        ("a + 'text'", 5, "\"'text'\" is none of the allowed forms"),
        ("a + True", 5, "'True' is none of the allowed forms"),
        ("a + 2j", 5, "'2j' is none of the allowed forms"),
        ("a // 2", 1, "'a // 2' is none of the allowed forms"),
        ("a < b", 1, "'a < b' is none of the allowed forms"),
        ("not a", 1, "'not a' is none of the allowed forms"),
        ("a + sqare(b)", 5, "'sqare' is not a known function. Did you mean 'square'?"),
        ("`wave 1` + sqrt(a, b)", 12, "'sqrt' takes one argument(s), not 2"),
        ("a + average()", 5, "'average' takes one or more argument(s), not 0"),
        ("a + mean()", 5, "'mean' takes one argument(s), not 0"),
        ("a + mean(a, b)", 5, "'mean' is the mean of one channel over time; the average of"),
        ("9**9**9 * a", 1, "an exponent is a number from -16 to 16"),
        ("a ** b", 1, "an exponent is a number from -16 to 16"),
        ("a ** -17", 1, "an exponent is a number from -16 to 16"),
        ("sqrt(a, axis=0)", 1, "'sqrt(a, axis=0)' is none of the allowed forms"),
        ("`wave 1`.x + a", 1, "'`wave 1`.x' is none of the allowed forms"),
        ("a b", 3, "this is not an arithmetic expression"),
        ("heave = a", 7, "this is not an arithmetic expression"),
    ],
)
def test_refused(text, position, what):
    with pytest.raises(RequestError) as caught:
        parse(text)
    assert f"is not allowed: at character {position}, {what}" in str(caught.value)
    assert "Allowed are numbers, channel names" in str(caught.value)


def test_cut_off():
    # Where a parser stops at the end of a text differs between versions of Python.
    with pytest.raises(RequestError, match="this is not an arithmetic expression"):
        parse("a + ")


def test_nothing_to_reckon_with():
    with pytest.raises(
        RequestError, match=r"the expression '1 \+ 2' names no channel, so it would"
    ):
        parse("1 + 2")
    with pytest.raises(RequestError, match="the expression ' ' is empty"):
        parse(" ")


def test_unknown_channel():
    with pytest.raises(
        RequestError,
        match=r"uses the channel 'acc_sp'.*Did you mean 'acc_sb'\? Channels: acc_sb, p",
    ):
        parse("acc_sp + 1").evaluate({"acc_sb": A, "pitch": B})


@pytest.mark.parametrize("text", ["1 / (a - 2)", "sqrt(b)", "a * 1e99**9", "b ** 0.5"])
def test_values_that_are_none(text):
    with pytest.raises(DataError, match=r"value\(s\) that are not finite, the first at sample"):
        parse(text).evaluate({"a": A, "b": B})


def test_channels_of_one_length():
    with pytest.raises(RequestError, match=r"channels of one length; .* a: \(3,\), b: \(2,\)"):
        parse("a + b").evaluate({"a": A, "b": B[:2]})
    with pytest.raises(RequestError, match="'a' holds 1 masked"):
        parse("a").evaluate({"a": np.ma.MaskedArray(A, [True, False, False])})


def test_as_deep_as_is_allowed():
    """From deep inside a program too."""

    def reckon(levels):
        if levels:
            return reckon(levels - 1)
        return parse("-" * 100 + "a").evaluate({"a": A})

    np.testing.assert_array_equal(reckon(400), A)
