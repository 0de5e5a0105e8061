"""What all tables of a campaign file are made of."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainSerializer,
    WrapValidator,
)

from seakeep.campaign.periods import Periods, parse_periods

__all__ = [
    "Band",
    "Finite",
    "Frequency",
    "Instant",
    "Interval",
    "Names",
    "Positive",
    "RunName",
    "Samples",
    "Span",
    "Table",
    "Window",
]


def _in_periods(power: int) -> WrapValidator:
    """Take a text in encounter periods, and leave all else to the number's own checks."""

    def either(value: Any, number: Callable[[Any], Any]) -> Any:
        if isinstance(value, str):
            value = parse_periods(value)
            if value.power != power:
                like = "'1.5 T', a length" if power == 1 else "'4 /T', a frequency"
                raise ValueError(f"in encounter periods this is written like {like}")
        return value if isinstance(value, Periods) else number(value)

    return WrapValidator(either)


def _positive(value: float) -> float:
    if isinstance(value, Periods) and not 0 < value.count < math.inf:
        raise ValueError("this is more than nothing, and finite")
    return value


def _finite(value: float) -> float:
    if isinstance(value, Periods) and not math.isfinite(value.count):
        raise ValueError("this is finite")
    return value


def _not_negative(value: float) -> float:
    if isinstance(value, Periods) and not 0 <= value.count < math.inf:
        raise ValueError("a length is finite, and 0 or more")
    return value


def rises(begin: float, end: float) -> bool:
    """Whether a pair rises; one in encounter periods beside one in seconds is not known yet."""
    counts = [each.count if isinstance(each, Periods) else each for each in (begin, end)]
    if any(map(math.isnan, counts)):
        return False
    mixed = isinstance(begin, Periods) != isinstance(end, Periods)
    return counts[0] < counts[1] or (mixed and all(map(math.isfinite, counts)))


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if not rises(*span):
        raise ValueError(
            "a span is [begin, end] in seconds of the file's clock or in encounter periods "
            "('10 T'), begin before end; 'inf' stands for the end of the record"
        )
    return span


def _rising_band(band: tuple[float, float]) -> tuple[float, float]:
    if not rises(*band):
        raise ValueError("a band is [low, high] in Hz or per encounter period ('4 /T'), low first")
    return band


def _as_written(value: int | float) -> int | float | str:
    return str(value) if isinstance(value, Periods) else value


_STATED = PlainSerializer(_as_written)
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Interval = Annotated[Positive, _in_periods(1), AfterValidator(_positive), _STATED]
"""A positive length of time, s, or in encounter periods."""
Instant = Annotated[Finite, _in_periods(1), AfterValidator(_finite), _STATED]
"""An instant, s, or in encounter periods."""
Samples = Annotated[int, Field(ge=0), _in_periods(1), AfterValidator(_not_negative), _STATED]
"""A number of samples, or :class:`Periods` that become samples once the step is known."""
Window = Annotated[int, Field(ge=2), _in_periods(1), AfterValidator(_positive), _STATED]
"""The same, of at least two samples."""
Frequency = Annotated[Positive, _in_periods(-1), AfterValidator(_positive), _STATED]
"""A frequency, Hz, or in encounter frequencies."""
Edge = Annotated[float, _in_periods(1), _STATED]
Span = Annotated[tuple[Edge, Edge], Field(strict=False), AfterValidator(_rising)]
Band = Annotated[tuple[Frequency, Frequency], Field(strict=False), AfterValidator(_rising_band)]
RunName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.+-]*$")]
Names = Annotated[tuple[str, ...], Field(strict=False)]


class Table(BaseModel):
    """A frozen table that refuses keys it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, populate_by_name=True)
