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

from seakeep.arrays import LARGEST, plain_number
from seakeep.errors import SHOWN, DataError, RequestError, SeakeepError

__all__ = ["checked", "explained"]

Function = TypeVar("Function", bound=Callable[..., Any])
Door = tuple[Callable[[object], bool], str]
"""Test of a value, and what a message calls values that pass it."""


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
    signature, misfit = inspect.signature(function), _misfit(function)

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        if words := misfit(signature.bind(*args, **kwargs).arguments):
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
    signature, misfit = inspect.signature(function), _misfit(function)

    def explain(error: Exception, args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        if isinstance(error, SeakeepError):
            return
        given: Mapping[str, Any] = {}
        with suppress(TypeError):  # arguments that are missing or too many
            given = signature.bind(*args, **kwargs).arguments
        if words := misfit(given):
            raise RequestError(words) from error
        if words := _unsound(given):
            raise DataError(words) from error

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


def _misfit(function: Callable[..., Any]) -> Callable[[Mapping[str, Any]], str]:
    """Return a function that says which argument of a call is of another type; empty for none."""

    @functools.cache
    def doors() -> dict[str, Door]:
        hints = _hints(function)
        return {
            name: _door(hints[name])
            for name, each in inspect.signature(function).parameters.items()
            if name in hints and each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
        }

    def words_of(given: Mapping[str, Any]) -> str:
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


def _door(hint: Any) -> Door:
    """Test of whether a value is of a type, and words for it; what cannot be tested passes."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint]
    if origin in _GENERIC:
        return _GENERIC[origin](parts)
    if not inspect.isclass(hint):
        return lambda value: True, "an array"
    words = f"{'an' if hint.__name__[0] in 'AEIOU' else 'a'} {hint.__name__}"
    if getattr(hint, "_is_protocol", False):
        members = [name for name in (*vars(hint), *hint.__annotations__) if name[0] != "_"]
        return lambda value: all(hasattr(value, name) for name in members), words
    return lambda value: isinstance(value, hint), words


def _either(parts: tuple[Any, ...]) -> Door:
    tests, words = zip(*map(_door, parts), strict=True)
    return lambda value: any(each(value) for each in tests), " or ".join(dict.fromkeys(words))


def _many(parts: tuple[Any, ...]) -> Door:
    of, words = _door(parts[0])
    return lambda value: _is_sequence(value) and all(map(of, value)), f"a list, each item {words}"


def _several(parts: tuple[Any, ...]) -> Door:
    of, words = _door(parts[0])
    return (
        lambda value: (
            isinstance(value, abc.Iterable)
            and not isinstance(value, str | bytes)
            and getattr(value, "ndim", 1) > 0
            and (not isinstance(value, abc.Sized) or all(map(of, value)))
        ),
        f"a list, each item {words}",
    )


def _row(parts: tuple[Any, ...]) -> Door:
    if Ellipsis in parts:
        return _many(parts)
    tests, words = zip(*map(_door, parts), strict=True)
    return (
        lambda value: (
            _is_sequence(value)
            and len(value) == len(tests)
            and all(each(one) for each, one in zip(tests, value, strict=True))
        ),
        f"{len(parts)} values ({', '.join(words)})",
    )


def _table(parts: tuple[Any, ...]) -> Door:
    (keys, of), (values, to) = map(_door, parts)
    return (
        lambda value: (
            isinstance(value, Mapping)
            and all(map(keys, value))
            and all(map(values, value.values()))
        ),
        f"a mapping, such as a dict, of {of} to {to}",
    )


def _words(parts: tuple[Any, ...]) -> Door:
    """One of several words: any text passes, as the function knows them, and which is near."""
    return _PLAIN[str][0], " or ".join(f"'{each}'" for each in parts)


_GENERIC: dict[Any, Callable[[tuple[Any, ...]], Door]] = {
    **dict.fromkeys((Union, types.UnionType), _either),
    **dict.fromkeys((abc.Sequence, list), _many),
    **dict.fromkeys((abc.Mapping, dict), _table),
    Literal: _words,
    tuple: _row,
    abc.Iterable: _several,
    abc.Callable: lambda parts: (callable, "a function"),
    type: lambda parts: (inspect.isclass, "a class"),
}


def _is_sequence(value: Any) -> typing.TypeGuard[Sequence[Any]]:
    is_array = getattr(value, "ndim", 0) > 0
    return is_array or (isinstance(value, Sequence) and not isinstance(value, str | bytes))


def _is_number(value: object) -> bool:
    plain = plain_number(value)
    is_real = isinstance(plain, numbers.Real) and not isinstance(plain, bool)
    real: Any = plain if is_real else math.nan
    return real == real and not LARGEST < abs(real) < math.inf


def _is_integer(value: object) -> bool:
    plain = plain_number(value)
    is_integer = isinstance(plain, numbers.Integral) and not isinstance(plain, bool)
    return is_integer and _is_number(plain)


_PLAIN: dict[Any, Door] = {
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
_SPAN = (_row((float, float))[0], "two instants in seconds")
_ATTRIBUTES: dict[str, Door] = {
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
