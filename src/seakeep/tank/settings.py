"""Settings of the virtual tank, read from TOML and validated before anything runs."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from seakeep.errors import RequestError, did_you_mean

__all__ = [
    "ClockSettings",
    "DriftSettings",
    "FacilitySettings",
    "HullSettings",
    "InstrumentSettings",
    "LineSettings",
    "PoolGeometry",
    "RunSettings",
    "SlapSettings",
    "TankSettings",
    "VesselSettings",
    "VideoSettings",
    "default_settings",
    "read_settings",
]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Pair = tuple[Positive, Positive]


class _Settings(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class PoolGeometry(_Settings):
    """Moon pool: a basin at the free surface above a shelf, a narrower opening below it (m)."""

    centre: float = -0.09
    length: Positive = 0.45
    beam: Positive = 0.36
    bottom_length: Positive = 0.36
    bottom_beam: Positive = 0.28
    shelf: Annotated[float, Field(lt=0)] = -0.035
    lid: Annotated[float, Field(lt=0)] = -0.01

    @model_validator(mode="after")
    def _nested(self) -> PoolGeometry:
        if self.bottom_length > self.length or self.bottom_beam > self.beam:
            raise ValueError("the pool's bottom opening must fit inside its free surface")
        if self.shelf >= self.lid:
            raise ValueError("the pool's shelf must lie below its lid")
        return self


class HullSettings(_Settings):
    """Dimensions of the hull and the panels of its mesh; read by the mesh builder alone."""

    mass: Positive = 60.7
    centre_of_gravity: float = 0.03
    pitch_gyradius: Positive = 0.36
    length_waterline: Positive = 1.34
    beam_waterline: Positive = 0.86
    waterplane_area: Positive = 0.9035
    bottom_taper: Annotated[float, Field(ge=0, lt=0.6)] = 0.3165
    pool: PoolGeometry | None = PoolGeometry()
    internal_lid: Annotated[float, Field(lt=0)] = -0.005
    panels_along: Annotated[int, Field(ge=4)] = 14
    panels_across: Annotated[int, Field(ge=4)] = 10
    panels_down: Annotated[int, Field(ge=2)] = 5
    panels_bottom: Annotated[int, Field(ge=2)] = 4
