"""Lengths and frequencies in encounter periods: ``"1.5 T"`` and ``"4 /T"``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import TypeVar

from pydantic import BaseModel

from seakeep.errors import RequestError

__all__ = ["Periods", "counted", "in_seconds", "parse_periods"]

_WRITTEN = re.compile(
    r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?inf)\s*(/?)\s*T\u0302?\s*"
)
Settings = TypeVar("Settings", bound=BaseModel)


class Periods(float):
    """A length in encounter periods, or a frequency in encounter frequencies.

    As a float it is NaN, so that nobody takes it for seconds or hertz before it has been turned
    into them by :meth:`at`.

    Parameters
    ----------
    count : float
        How many.
    power : {1, -1}
        1 for a length, -1 for a frequency.

    Examples
    --------
    >>> str(Periods(1.5)), Periods(1.5).at(1.64), str(Periods(4.0, -1))
    ('1.5 T', 2.46, '4 /T')
    """

    count: float
    power: int

    def __new__(cls, count: float, power: int = 1) -> Periods:
        """Make a NaN that knows its count."""
        self = super().__new__(cls, math.nan)
        self.count, self.power = float(count), power
        return self

    def at(self, period: float) -> float:
        """Seconds or hertz, for an encounter period in seconds."""
        return self.count * period**self.power

    def __str__(self) -> str:
        return f"{self.count:.15g} {'/' * (self.power < 0)}T"

    __repr__ = __str__

    def __format__(self, form: str) -> str:
        return str(self)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Periods):
            return False
        return (self.count, self.power) == (other.count, other.power)

    def __hash__(self) -> int:
        return hash((self.count, self.power))

    def __reduce__(self) -> tuple[type[Periods], tuple[float, int]]:
        return Periods, (self.count, self.power)


def parse_periods(text: str) -> Periods:
    """Read a length or a frequency in encounter periods.

    Parameters
    ----------
    text : str
        A number and the unit ``T``: ``"1.5 T"``, ``"inf T"``, ``"4 /T"``.

    Returns
    -------
    Periods
        What it says.

    Raises
    ------
    RequestError
        If it says something else.

    Examples
    --------
    >>> parse_periods("15 T").at(2.0), parse_periods("4 /T").at(2.0)
    (30.0, 2.0)
    """
    match = _WRITTEN.fullmatch(text)
    if match is None:
        raise RequestError(
            "a text in place of a number counts in encounter periods, such as '1.5 T' or '4 /T'; "
            "seconds, samples and hertz are numbers without quotes"
        )
    return Periods(float(match[1]), -1 if match[2] else 1)


def _children(table: BaseModel) -> Iterator[tuple[str, object]]:
    for name in type(table).model_fields:
        yield name, getattr(table, name)
    yield from (table.model_extra or {}).items()


def counted(value: object, place: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Keys of a table, as paths, whose values count in encounter periods."""
    if isinstance(value, Periods):
        yield place
    elif isinstance(value, BaseModel):
        for name, each in _children(value):
            yield from counted(each, (*place, name))
    elif isinstance(value, dict):
        for name, each in value.items():
            yield from counted(each, (*place, str(name)))
    elif isinstance(value, tuple) and any(isinstance(each, Periods) for each in value):
        yield place


def in_seconds(table: Settings, period: float, place: tuple[str, ...] = ()) -> Settings:
    """Turn all that counts in encounter periods into seconds and hertz.

    Parameters
    ----------
    table : BaseModel
        Settings, tables in them included.
    period : float
        Encounter period, s.
    place : tuple of str, optional
        Where the table stands, for messages.

    Returns
    -------
    BaseModel
        A copy; the table itself where nothing in it counts in periods.

    Raises
    ------
    RequestError
        If a pair of which one is stated in periods does not rise.
    """
    update = {
        name: _turned(value, period, (*place, name))
        for name, value in _children(table)
        if any(True for _ in counted(value))
    }
    return table.model_copy(update=update) if update else table


def _turned(value: object, period: float, place: tuple[str, ...]) -> object:
    if isinstance(value, Periods):
        return value.at(period)
    if isinstance(value, BaseModel):
        return in_seconds(value, period, place)
    if isinstance(value, dict):
        return {name: _turned(each, period, (*place, str(name))) for name, each in value.items()}
    if isinstance(value, tuple):
        turned = tuple(_turned(each, period, place) for each in value)
        if len(turned) == 2 and not turned[0] < turned[1]:  # type: ignore[operator]
            raise RequestError(
                f"{'.'.join(place)}: received [{value[0]}, {value[1]}], which with an encounter "
                f"period of {period:.6g} s is [{turned[0]:g}, {turned[1]:g}]. State the lower one "
                "first."
            )
        return turned
    return value
