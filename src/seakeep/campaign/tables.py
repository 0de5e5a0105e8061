"""What all tables of a campaign file are made of."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

__all__ = ["Finite", "Names", "Positive", "RunName", "Span", "Table"]


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if math.isnan(span[0]) or math.isnan(span[1]) or not span[0] < span[1]:
        raise ValueError(
            "a span is [begin, end] in seconds of the file's clock, begin before end; "
            "'inf' stands for the end of the record"
        )
    return span


Span = Annotated[tuple[float, float], Field(strict=False), AfterValidator(_rising)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
RunName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.+-]*$")]
Names = Annotated[tuple[str, ...], Field(strict=False)]


class Table(BaseModel):
    """A frozen table that refuses keys it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, populate_by_name=True)
