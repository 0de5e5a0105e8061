"""Arguments of public functions, compared with their annotations before the functions run.

:func:`checked` is the door of the Python API: what is not of the annotated type is refused with the
argument's name, what was received, and what is wanted. Arrays pass: :mod:`seakeep.arrays` judges
their shapes and values.
"""

from __future__ import annotations

import collections.abc
import functools
import inspect
import math
import numbers
import os
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

import numpy as np

from seakeep.arrays import LARGEST
from seakeep.errors import SHOWN, RequestError

__all__ = ["checked"]

Function = TypeVar("Function", bound=Callable[..., Any])
Fits = Callable[[object], bool]


def checked(function: Function) -> Function:
    """Compare the arguments of a function with its annotations in each call.

    Parameters
    ----------
    function : callable
        A function or method; its annotations must exist at run time, not for type checkers only.

    Returns
    -------
    callable
        The same function. It raises a :class:`seakeep.RequestError` if an argument is of another
        type: numbers of numpy are numbers, NaN is none, and a text is no sequence of texts.

    Examples
    --------
    >>> @checked
    ... def shift(series: list[float], by: float = 0.0) -> None: ...
    >>> shift([1.0], by="2 s")
    Traceback (most recent call last):
    seakeep.errors.RequestError: by must be a number; received '2 s'.
    """
    signature = inspect.signature(function)

    @functools.cache
    def doors() -> dict[str, tuple[Fits, str]]:
        hints = typing.get_type_hints(function)
        return {
            name: (_fits(hints[name]), _words(hints[name]))
            for name, each in signature.parameters.items()
            if name in hints and each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
        }

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        given = signature.bind(*args, **kwargs).arguments
        for name, (fits, words) in doors().items():
            if name in given and not fits(given[name]):
                raise RequestError(f"{name} must be {words}; received {_shown(given[name])}.")
        return function(*args, **kwargs)

    return typing.cast(Function, call)


def _fits(hint: Any) -> Fits:
    """Test of whether a value is of a type; what cannot be tested passes."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Union, types.UnionType):
        either = [_fits(each) for each in parts]
        return lambda value: any(each(value) for each in either)
    if origin is Literal:
        return _PLAIN[str][0]  # the function knows the words, and which is near
    if hint in _PLAIN:
        return _PLAIN[hint][0]
    if origin is tuple and Ellipsis not in parts:
        inner = [_fits(each) for each in parts]
        return lambda value: (
            _is_sequence(value)
            and len(value) == len(inner)
            and all(each(one) for each, one in zip(inner, value, strict=True))
        )
    if origin in (collections.abc.Sequence, list, tuple):
        of = _fits(parts[0])
        return lambda value: _is_sequence(value) and all(map(of, value))
    if origin in (collections.abc.Mapping, dict):
        keys, values = map(_fits, parts)
        return lambda value: (
            isinstance(value, Mapping)
            and all(map(keys, value))
            and all(map(values, value.values()))
        )
    if origin is collections.abc.Callable:
        return callable
    if inspect.isclass(hint) and not getattr(hint, "_is_protocol", False):
        return lambda value: isinstance(value, hint)
    return lambda value: True


def _words(hint: Any) -> str:
    """What a message calls a type."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(map(_words, parts)))
    if origin is Literal:
        return " or ".join(f"'{each}'" for each in parts)
    if hint in _PLAIN:
        return _PLAIN[hint][1]
    if origin is tuple and Ellipsis not in parts:
        return f"{len(parts)} values ({', '.join(map(_words, parts))})"
    if origin in (collections.abc.Sequence, list, tuple):
        return f"a list (of each: {_words(parts[0])})"
    if origin in (collections.abc.Mapping, dict):
        return f"a mapping, such as a dict, of {_words(parts[0])} to {_words(parts[1])}"
    if origin is collections.abc.Callable:
        return "a function"
    name = getattr(hint, "__name__", "")
    return f"a {name}" if inspect.isclass(hint) else "an array"


def _is_sequence(value: Any) -> typing.TypeGuard[Sequence[Any]]:
    is_array = getattr(value, "ndim", 0) > 0
    return is_array or (isinstance(value, Sequence) and not isinstance(value, str | bytes))


def _plain(value: Any) -> object:
    """Number of numpy, or of an array of one value, as one of Python."""
    if not hasattr(value, "item") or value is np.ma.masked or np.size(value) != 1:
        return value
    return value.item()


def _is_number(value: object) -> bool:
    plain = _plain(value)
    is_real = isinstance(plain, numbers.Real) and not isinstance(plain, bool)
    real: Any = plain if is_real else math.nan
    return real == real and not LARGEST < abs(real) < math.inf


def _is_integer(value: object) -> bool:
    plain = _plain(value)
    is_integer = isinstance(plain, numbers.Integral) and not isinstance(plain, bool)
    return is_integer and _is_number(plain)


_PLAIN: dict[Any, tuple[Fits, str]] = {
    float: (_is_number, "a number"),
    int: (_is_integer, "an integer"),
    bool: (lambda value: isinstance(value, bool | np.bool_), "True or False"),
    str: (lambda value: isinstance(value, str), "a text"),
    Path: (lambda value: isinstance(value, os.PathLike), "a Path"),
    type(None): (lambda value: value is None, "None"),
    object: (lambda value: True, "anything"),
    Any: (lambda value: True, "anything"),
    np.random.Generator: (
        lambda value: isinstance(value, np.random.Generator),
        "a numpy.random.Generator, such as numpy.random.default_rng(0)",
    ),
}


def _shown(value: object) -> str:
    """What was received, in as few characters as a message has room for."""
    if isinstance(value, int) and abs(value) > LARGEST:
        return "an integer of more than 300 digits"
    kind = type(value)
    if kind.__module__ != "builtins":
        return repr(value) if isinstance(value, np.generic) else f"a {kind.__name__}"
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}…"
