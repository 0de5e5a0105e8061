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
import numpy.typing as npt

from seakeep.arrays import FloatArray, as_real
from seakeep.errors import DataError, RequestError, did_you_mean

__all__ = ["Expression", "Text", "parse"]

GREATEST_EXPONENT = 16.0
"""A physical law has no higher power; 9**9**9 has."""

_OPERATORS: dict[type[ast.operator], str] = {
    ast.Add: "add",
    ast.Sub: "subtract",
    ast.Mult: "multiply",
    ast.Div: "divide",
    ast.Pow: "power",
}
_FUNCTIONS = ("square", "abs", "sqrt", "sin", "cos")
_ALLOWED = (
    "numbers, channel names, + - * / **, parentheses, and the functions "
    "square, abs, sqrt, sin, cos, mean, average"
)
_QUOTED = re.compile(r"`([^`]*)`")


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

    def evaluate(self, values: Mapping[str, npt.ArrayLike]) -> FloatArray:
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
        RequestError
            If a channel that the expression uses is not among `values`.
        DataError
            If the value is not finite somewhere (a division by zero, the root of a negative).

        Examples
        --------
        >>> parse("2 * a - mean(a)").evaluate({"a": [1.0, 2.0, 3.0]})
        array([0., 2., 4.])
        """
        for name in self.channels:
            if name not in values:
                raise RequestError(
                    f"the expression {self.text!r} uses the channel '{name}', which does not "
                    f"exist.{did_you_mean(name, values)} Channels: {', '.join(values)}."
                )
        arrays = {name: as_real(values[name], f"'{name}'") for name in self.channels}
        shapes = {array.shape for array in arrays.values()}
        if len(shapes) > 1 or () in shapes:
            raise RequestError(
                f"the expression {self.text!r} needs channels of one length; received shapes "
                f"{', '.join(f'{name}: {array.shape}' for name, array in arrays.items())}."
            )
        with np.errstate(all="ignore"):
            out = self.of(arrays.__getitem__)
        result: FloatArray = np.array(np.broadcast_to(out, shapes.pop()))
        if not np.all(np.isfinite(result)):
            bad = np.flatnonzero(~np.isfinite(result))
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
            if isinstance(node, ast.Constant):
                return float(node.value)  # type: ignore[arg-type]
            if isinstance(node, ast.Name):
                return channel(self._quoted.get(node.id, node.id))
            if isinstance(node, ast.BinOp):
                return _apply(_OPERATORS[type(node.op)], [value(node.left), value(node.right)])
            if isinstance(node, ast.UnaryOp):
                operand = value(node.operand)
                return _apply("negative", [operand]) if isinstance(node.op, ast.USub) else operand
            assert isinstance(node, ast.Call)
            assert isinstance(node.func, ast.Name)
            return _apply(node.func.id, [value(argument) for argument in node.args])

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

    def _with(self, pattern: str, other: Any, *, turned: bool = False) -> Text:
        texts = (self.text, other.text if isinstance(other, Text) else self.number(float(other)))
        return replace(self, text=pattern.format(*(texts[::-1] if turned else texts)))

    __add__ = partialmethod(_with, "({0} + {1})")
    __sub__ = partialmethod(_with, "({0} - {1})")
    __mul__ = partialmethod(_with, "({0} * {1})")
    __truediv__ = partialmethod(_with, "({0} / {1})")
    __radd__ = partialmethod(_with, "({0} + {1})", turned=True)
    __rsub__ = partialmethod(_with, "({0} - {1})", turned=True)
    __rmul__ = partialmethod(_with, "({0} * {1})", turned=True)
    __rtruediv__ = partialmethod(_with, "({0} / {1})", turned=True)

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


def _apply(name: str, values: list[Any]) -> Any:
    """Value of an operation."""
    return (
        sum(values[1:], values[0]) / len(values)
        if name == "average"
        else getattr(np, name)(*values)
    )


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
    plain, quoted = _unquoted(text)
    channels: dict[str, None] = {}

    def refusal(position: int, reason: str) -> RequestError:
        return RequestError(
            f"the expression {text!r} is not allowed: at character {position}, {reason}. "
            f"Allowed are {_ALLOWED}; write names with blanks or signs between backticks."
        )

    def check(node: ast.expr) -> None:
        source = ast.get_source_segment(plain, node) or plain
        for stand_in, name in quoted.items():
            source = source.replace(stand_in, f"`{name}`")
        if isinstance(node, ast.Name):
            channels[quoted.get(node.id, node.id)] = None
        wrong, operands = _judged(node, source)
        if wrong:
            raise refusal(len(plain.encode()[: node.col_offset].decode()) + 1, wrong)
        for each in operands:
            check(each)

    try:
        tree = ast.parse(plain, mode="eval").body
    except SyntaxError as error:
        raise refusal(error.offset or 1, "this is not an arithmetic expression") from None
    check(tree)
    if not channels:
        raise RequestError(
            f"the expression {text!r} names no channel, so it would be a constant. "
            "Write the name of a channel in it."
        )
    return Expression(text, tuple(channels), tree, quoted)


def _unquoted(text: str) -> tuple[str, dict[str, str]]:
    """Put identifiers of the same length for names between backticks."""
    quoted: dict[str, str] = {}

    def stand_in(match: re.Match[str]) -> str:
        # A click letter, which may be part of an identifier and which no channel is called.
        name = f"\u01c3{len(quoted)}".ljust(len(match[0]), "_")
        quoted[name] = match[1]
        return name

    return _QUOTED.sub(stand_in, text), quoted


def _judged(node: ast.expr, source: str) -> tuple[str, list[ast.expr]]:
    """What is wrong with a node, empty for nothing, and its operands."""
    if isinstance(node, ast.Name) or _number(node) is not None:
        return "", []
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        wrong = isinstance(node.op, ast.Pow) and not _is_exponent(node.right)
        limits = f"an exponent is a number from -{GREATEST_EXPONENT:g} to {GREATEST_EXPONENT:g}"
        return limits * wrong, [node.left, node.right]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return "", [node.operand]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        return _wrong_call(node.func.id, len(node.args)), node.args
    return f"{source!r} is none of the allowed forms", []


def _number(node: ast.expr) -> float | None:
    """Value of a plain number; None for all else."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)  # type: ignore[arg-type]
    return None


def _is_exponent(node: ast.expr) -> bool:
    """Whether a node is a number that a physical law may have as an exponent."""
    signed = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub)
    number = _number(node.operand if signed else node)  # type: ignore[attr-defined]
    return number is not None and number <= GREATEST_EXPONENT


def _wrong_call(name: str, count: int) -> str:
    """What is wrong with a call of a function with so many arguments; empty for nothing."""
    known = [*_FUNCTIONS, "mean", "average"]
    if name not in known:
        return f"'{name}' is not a known function.{did_you_mean(name, known)}".rstrip(".")
    if name == "mean" and count > 1:
        return (
            "'mean' is the mean of one channel over time; the average of several channels, instant "
            "by instant, is 'average'"
        )
    wanted = "one or more" if name == "average" else "one"
    fits = count == 1 or (count > 1 and name == "average")
    return "" if fits else f"'{name}' takes {wanted} argument(s), not {count}"
