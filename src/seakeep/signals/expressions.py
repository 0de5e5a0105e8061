"""Arithmetic of channels, written as text and parsed, never evaluated as Python.

An expression knows numbers, channel names, ``+ - * / **``, parentheses, and the functions
``square``, ``abs``, ``sqrt``, ``sin``, ``cos``, ``mean`` and ``average``. ``mean(a)`` is the mean
of a channel over time, so that ``a - mean(a)`` is the deviation; ``average(a, b)`` is that of
several values instant by instant. A name that is not an identifier stands between backticks.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partialmethod
from typing import Any

import numpy as np

from seakeep.arrays import ArrayLike, FloatArray, as_real
from seakeep.errors import DataError, RequestError, did_you_mean

GREATEST_EXPONENT = 16
"""A physical law has no higher power; 9**9**9 has."""
_OPERATORS = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}


def _average(*values: Any) -> Any:
    """Mean of several values, instant by instant."""
    return sum(values[1:], values[0]) / len(values)


_FUNCTIONS = {name: getattr(np, name) for name in ("square", "abs", "sqrt", "sin", "cos", "mean")}
_FUNCTIONS["average"] = _average
_ALLOWED = "numbers, channel names, + - * / **, parentheses, and the functions " + ", ".join(
    _FUNCTIONS
)


class _RefusedError(Exception):
    """A node that is not allowed, and the reason; none is one of another form."""

    def __init__(self, node: ast.expr, reason: str = "") -> None:
        self.node, self.reason = node, reason


@dataclass(frozen=True)
class Expression:
    """A parsed expression; made by :func:`parse`.

    Parameters
    ----------
    text : str
        What was parsed.
    channels : tuple of str
        Names of the channels it uses, in the order in which they appear.
    """

    text: str
    channels: tuple[str, ...]
    _tree: ast.expr = field(repr=False, compare=False)
    _quoted: Mapping[str, str] = field(repr=False, compare=False)

    def evaluate(self, values: Mapping[str, ArrayLike]) -> FloatArray:
        """Value of the expression.

        Parameters
        ----------
        values : mapping of str to array_like, shape (time,)
            The channels by name, all of one length.

        Returns
        -------
        ndarray, shape (time,)
            The value at each instant.

        Raises
        ------
        DataError
            If the value is not finite somewhere (a division by zero, the root of a negative).

        Examples
        --------
        >>> parse("2 * a - mean(a)").evaluate({"a": [1.0, 2.0, 3.0]})
        array([0., 2., 4.])
        """
        arrays = {name: as_real(values[name], f"'{name}'") for name in self.channels}
        with np.errstate(all="ignore"):
            out = self.of(arrays.__getitem__)
        # Of means alone it is one number.
        result = np.array(np.broadcast_to(out, arrays[self.channels[0]].shape))
        if (bad := np.flatnonzero(~np.isfinite(result))).size:
            raise DataError(
                f"the expression {self.text!r} gives {bad.size} value(s) that are not finite, the "
                f"first at sample {bad[0]}. Look for a division by zero, the root of a negative "
                "number, or gaps in its channels."
            )
        return result

    def of(self, channel: Callable[[str], Any]) -> Any:
        """Value of the expression of anything that knows the arithmetic of numpy.

        Parameters
        ----------
        channel : callable
            Value of a channel by its name: an array, text in another language, nodes of a graph.

        Returns
        -------
        object
            Value of the whole.
        """

        def value(node: ast.expr) -> Any:
            match node:
                case ast.Constant(float() | int() as constant):
                    return float(constant)
                case ast.Name(name):
                    return channel(self._quoted.get(name, name))
                case ast.UnaryOp(ast.USub(), operand):
                    return np.negative(value(operand))
                case ast.UnaryOp(ast.UAdd(), operand):
                    return value(operand)
                case ast.BinOp(left, operator, right) if type(operator) in _OPERATORS:
                    if isinstance(operator, ast.Pow) and not _is_exponent(right):
                        raise _RefusedError(
                            node,
                            f"an exponent is a number from -{GREATEST_EXPONENT} to "
                            f"{GREATEST_EXPONENT}",
                        )
                    return _OPERATORS[type(operator)](value(left), value(right))
                case ast.Call(ast.Name(name), arguments, []):
                    if wrong := _wrong_call(name, len(arguments)):
                        raise _RefusedError(node, wrong)
                    return _FUNCTIONS[name](*map(value, arguments))
            raise _RefusedError(node)

        return value(self._tree)


@dataclass(frozen=True)
class Text:
    """An expression of another language, which the arithmetic of numpy on objects continues.

    Parameters
    ----------
    text : str
        The expression.
    number : callable, optional
        Text of a number.
    power : str, optional
        Power of ``{0}`` to ``{1}``, as C has it.
    absolute : str, optional
        Name of the function of the absolute value.
    """

    text: str
    number: Callable[[float], str] = field(default=repr, repr=False)
    power: str = "pow({0}, {1})"
    absolute: str = "fabs"

    def __str__(self) -> str:
        return self.text

    def _with(self, pattern: str, other: Any) -> Text:
        text = other.text if isinstance(other, Text) else self.number(float(other))
        return replace(self, text=pattern.format(self.text, text))

    __add__ = partialmethod(_with, "({0} + {1})")
    __sub__ = partialmethod(_with, "({0} - {1})")
    __mul__ = partialmethod(_with, "({0} * {1})")
    __truediv__ = partialmethod(_with, "({0} / {1})")
    __radd__ = partialmethod(_with, "({1} + {0})")
    __rsub__ = partialmethod(_with, "({1} - {0})")
    __rmul__ = partialmethod(_with, "({1} * {0})")
    __rtruediv__ = partialmethod(_with, "({1} / {0})")

    def __pow__(self, exponent: float) -> Text:
        return self._with(self.power, exponent)

    def __abs__(self) -> Text:
        return self._of(self.absolute)

    def _of(self, function: str) -> Text:
        return replace(self, text=f"{function}({self.text})")

    __neg__ = partialmethod(_of, "-")
    sqrt = partialmethod(_of, "sqrt")
    sin = partialmethod(_of, "sin")
    cos = partialmethod(_of, "cos")


def parse(text: str) -> Expression:
    """Parse an expression of channels.

    Parameters
    ----------
    text : str
        Such as ``"0.5*(acc_sb + acc_ps)"``.

    Returns
    -------
    Expression
        Its parsed form, with the names of the channels that it uses.

    Raises
    ------
    RequestError
        If the text is not an expression, names no channel, or uses what is not allowed; the message
        says what and where.

    Examples
    --------
    >>> parse("square(`wave probe 1`) / 2 + heave").channels
    ('wave probe 1', 'heave')
    """
    if not text.strip():
        raise RequestError(f"the expression {text!r} is empty. Write one of {_ALLOWED}.")
    text = " ".join(text.strip().splitlines())
    quoted: dict[str, str] = {}

    def stand_in(match: re.Match[str]) -> str:
        # Of the same length; with a click letter, which may be part of an identifier and which no
        # channel is called.
        name = f"\u01c3{len(quoted)}".ljust(len(match[0]), "_")
        quoted[name] = match[1]
        return name

    plain = re.sub(r"`([^`]*)`", stand_in, text)
    channels: dict[str, str] = {}
    try:
        named = Expression(text, (), ast.parse(plain, mode="eval").body, quoted)
        with np.errstate(all="ignore"):
            named.of(lambda name: Text(channels.setdefault(name, name)))
    except (SyntaxError, _RefusedError) as error:
        place, reason = getattr(error, "offset", 0) or 1, "this is not an arithmetic expression"
        if isinstance(error, _RefusedError):
            source = ast.get_source_segment(plain, error.node) or plain
            for each, name in quoted.items():
                source = source.replace(each, f"`{name}`")
            place = len(plain.encode()[: error.node.col_offset].decode()) + 1
            reason = error.reason or f"{source!r} is none of the allowed forms"
        raise RequestError(
            f"the expression {text!r} is not allowed: at character {place}, {reason}. "
            f"Allowed are {_ALLOWED}; write names with blanks or signs between backticks."
        ) from None
    if not channels:
        raise RequestError(
            f"the expression {text!r} names no channel, so it would be a constant. "
            "Write the name of a channel in it."
        )
    return replace(named, channels=tuple(channels))


def _is_exponent(node: ast.expr) -> bool:
    """Whether a node is a number that a physical law may have as an exponent."""
    match node:
        case ast.Constant(float() | int() as size) | ast.UnaryOp(
            ast.USub(), ast.Constant(float() | int() as size)
        ):
            return size <= GREATEST_EXPONENT
    return False


def _wrong_call(name: str, count: int) -> str:
    """What is wrong with a call of a function with so many arguments; empty for nothing."""
    if name not in _FUNCTIONS:
        return f"'{name}' is not a known function.{did_you_mean(name, _FUNCTIONS)}".rstrip(".")
    if name == "mean" and count > 1:
        return (
            "'mean' is the mean of one channel over time; the average of several channels, instant "
            "by instant, is 'average'"
        )
    if count == 1 or (name == "average" and count):
        return ""
    wanted = "one or more" if name == "average" else "one"
    return f"'{name}' takes {wanted} argument(s), not {count}"
