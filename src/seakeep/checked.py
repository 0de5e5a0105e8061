"""Arguments of public functions, compared with their annotations.

:func:`checked` does so before a function of arrays runs, :func:`explained` where another function
ended in an error of Python: what is not of the annotated type is refused with the argument's name,
what was received, and what is wanted. Arrays pass: :mod:`seakeep.arrays` judges their shapes and
values.
"""

from __future__ import annotations

import functools
import inspect
import math
import numbers
import os
import types
import typing
from collections import abc
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

import numpy as np

from seakeep.arrays import LARGEST
from seakeep.errors import SHOWN, DataError, RequestError, SeakeepError

__all__ = ["checked", "explained"]

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
    misfit = _misfit(function)

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        if words := misfit(args, kwargs):
            raise RequestError(words)
        return function(*args, **kwargs)

    return typing.cast(Function, call)


def explained(function: Function) -> Function:
    """Compare the arguments of a function with its annotations where a call ends in an error.

    For functions and methods whose own checks are more telling than types: they run first. An error
    that is none of ours becomes a :class:`seakeep.RequestError` if an argument is of another type
    than its annotation, and is raised as it is if none is.

    Parameters
    ----------
    function : callable
        A function, a method, or a class that is made with such arguments.

    Returns
    -------
    callable
        The same function or class.
    """
    if inspect.isclass(function):
        made: Any = function
        made.__init__ = explained(made.__init__)
        return function
    misfit = _misfit(function)

    signature = inspect.signature(function)

    def explain(error: Exception, args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        if isinstance(error, SeakeepError):
            return
        words = unsound = ""
        with suppress(TypeError):  # arguments that are missing or too many
            words = misfit(args, kwargs)
            unsound = _unsound(signature.bind(*args, **kwargs).arguments)
        if words:
            raise RequestError(words) from error
        if unsound:
            raise DataError(unsound) from error

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except Exception as error:
            explain(error, args, kwargs)
            raise

    @functools.wraps(function)
    def iterate(*args: Any, **kwargs: Any) -> Any:
        try:
            yield from function(*args, **kwargs)
        except Exception as error:
            explain(error, args, kwargs)
            raise

    return typing.cast(Function, iterate if inspect.isgeneratorfunction(function) else call)


def _unsound(given: Mapping[str, Any]) -> str:
    """What the first run among arguments lacks; empty for nothing."""
    model = given.get("model", given.get("self"))
    wanted = [*getattr(model, "states", ()), *getattr(model, "inputs", ())]
    for name in ("run", "runs", "prepared", "like"):
        value = given.get(name)
        runs = value if isinstance(value, dict) else {name: value}
        for run, data in runs.items():
            if hasattr(data, "data_vars") and (words := _lacking(data, wanted)):
                return f"'{run}' {words}"
    return ""


def _lacking(run: Any, wanted: Sequence[str]) -> str:
    """What is wrong with a Dataset that should be a run; empty for nothing."""
    if "time" not in run.coords:
        return "has no coordinate 'time'. Name its axis so, and give the instants in seconds."
    time = np.asarray(run["time"].values)
    if time.dtype.kind not in "fiu":
        return (
            f"has times of type {time.dtype}, and seconds are needed: (t - t[0]) / "
            "numpy.timedelta64(1, 's')."
        )
    if time.size < 2 or not np.all(np.isfinite(time)):
        finite = int(np.count_nonzero(np.isfinite(time)))
        return f"has {finite} finite instant(s) in time. Give two samples or more, and no NaN."
    if missing := [name for name in wanted if name not in run]:
        return (
            f"has no channel '{missing[0]}', which the model takes. Channels: "
            f"{', '.join(map(str, run.data_vars)) or 'none'}."
        )
    for key, (fits, words) in _ATTRIBUTES.items():
        if key in run.attrs and not fits(run.attrs[key]):
            return f"has the attribute {key} = {_shown(run.attrs[key])}, which should be {words}."
    for name, channel in run.data_vars.items():
        if not isinstance(channel.attrs.get("units", ""), str):
            return f"has a channel {name} whose attribute 'units' is no text. Write 'm' or 'rad'."
    return ""


def _misfit(function: Callable[..., Any]) -> Callable[[tuple[Any, ...], dict[str, Any]], str]:
    """Return a function that says which argument of a call is of another type; empty for none."""
    signature = inspect.signature(function)

    @functools.cache
    def doors() -> dict[str, tuple[Fits, str]]:
        hints = _hints(function)
        return {
            name: (_fits(hints[name]), _words(hints[name]))
            for name, each in signature.parameters.items()
            if name in hints and each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
        }

    def words_of(args: tuple[Any, ...], kwargs: dict[str, Any]) -> str:
        given = signature.bind(*args, **kwargs).arguments
        for name, (fits, words) in doors().items():
            if name in given and not fits(given[name]):
                return f"{name} must be {words}; received {_shown(given[name])}."
        return ""

    return words_of


def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    """Annotations but those of an extra, which are imported for type checkers alone."""
    inner = inspect.unwrap(function)
    found: dict[str, Any] = {}
    for name, text in inner.__annotations__.items():
        one = types.SimpleNamespace(__annotations__={name: text})
        with suppress(NameError):
            found |= typing.get_type_hints(one, inner.__globals__)
    return found


def _fits(hint: Any) -> Fits:
    """Test of whether a value is of a type; what cannot be tested passes."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint][0]
    if origin in _GENERIC:
        return _GENERIC[origin][0](parts)
    if getattr(hint, "_is_protocol", False):
        members = [
            name for name in (*vars(hint), *getattr(hint, "__annotations__", ())) if name[0] != "_"
        ]
        return lambda value: all(hasattr(value, name) for name in members)
    if inspect.isclass(hint):
        return lambda value: isinstance(value, hint)
    return lambda value: True


def _words(hint: Any) -> str:
    """What a message calls a type."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint][1]
    if origin in _GENERIC:
        return _GENERIC[origin][1](parts)
    if not inspect.isclass(hint):
        return "an array"
    return f"{'an' if hint.__name__[0] in 'AEIOU' else 'a'} {hint.__name__}"


def _either(parts: tuple[Any, ...]) -> Fits:
    tests = [_fits(each) for each in parts]
    return lambda value: any(each(value) for each in tests)


def _many(parts: tuple[Any, ...]) -> Fits:
    of = _fits(parts[0])
    return lambda value: _is_sequence(value) and all(map(of, value))


def _several(parts: tuple[Any, ...]) -> Fits:
    of = _fits(parts[0])
    return lambda value: (
        isinstance(value, abc.Iterable)
        and not isinstance(value, str | bytes)
        and getattr(value, "ndim", 1) > 0
        and (not isinstance(value, abc.Sized) or all(map(of, value)))
    )


def _row(parts: tuple[Any, ...]) -> Fits:
    if Ellipsis in parts:
        return _many(parts)
    tests = [_fits(each) for each in parts]
    return lambda value: (
        _is_sequence(value)
        and len(value) == len(tests)
        and all(each(one) for each, one in zip(tests, value, strict=True))
    )


def _table(parts: tuple[Any, ...]) -> Fits:
    keys, values = map(_fits, parts)
    return lambda value: (
        isinstance(value, Mapping) and all(map(keys, value)) and all(map(values, value.values()))
    )


def _join(parts: tuple[Any, ...]) -> str:
    return " or ".join(dict.fromkeys(map(_words, parts)))


def _list_words(parts: tuple[Any, ...]) -> str:
    return f"a list, each item {_words(parts[0])}"


def _row_words(parts: tuple[Any, ...]) -> str:
    if Ellipsis in parts:
        return _list_words(parts)
    return f"{len(parts)} values ({', '.join(map(_words, parts))})"


def _table_words(parts: tuple[Any, ...]) -> str:
    return f"a mapping, such as a dict, of {_words(parts[0])} to {_words(parts[1])}"


_GENERIC: dict[Any, tuple[Callable[[Any], Fits], Callable[[Any], str]]] = {
    Union: (_either, _join),
    types.UnionType: (_either, _join),
    # The function knows the words, and which is near.
    Literal: (lambda parts: _PLAIN[str][0], lambda parts: " or ".join(f"'{e}'" for e in parts)),
    tuple: (_row, _row_words),
    **dict.fromkeys((abc.Sequence, list), (_many, _list_words)),
    **dict.fromkeys((abc.Mapping, dict), (_table, _table_words)),
    abc.Iterable: (_several, _list_words),
    abc.Callable: (lambda parts: callable, lambda parts: "a function"),
    type: (lambda parts: inspect.isclass, lambda parts: "a class"),
}


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


_NUMBER = (_is_number, "a number")
_SPAN = (_row((float, float)), "two instants in seconds")
_ATTRIBUTES: dict[str, tuple[Fits, str]] = {
    **dict.fromkeys(("encounter_period", "water_depth", "probe_offset", "celerity"), _NUMBER),
    **dict.fromkeys(("train_span", "test_span"), _SPAN),
}
"""Attributes of a run that functions read."""


def _shown(value: object) -> str:
    """What was received, in as few characters as a message has room for."""
    if isinstance(value, int) and abs(value) > LARGEST:
        return "an integer of more than 300 digits"
    kind = type(value)
    if kind.__module__ != "builtins":
        return repr(value) if isinstance(value, np.generic) else f"a {kind.__name__}"
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}…"
