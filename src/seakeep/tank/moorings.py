"""Mooring lines that only pull: their TOML table, geometry, stiffness at rest.

A model of a line is an entry of :data:`KINDS`: it says how the tension grows with the stretch, as a
cubic, and the time loop knows nothing else of it.
"""

from collections.abc import Callable, Mapping
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator

from seakeep.arrays import FloatArray
from seakeep.errors import RequestError, did_you_mean
from seakeep.toml import Finite, NotNegative, Positive, Table

Elasticity = tuple[float, float, float]
"""Coefficients of a tension that is a cubic in the stretch: N/m, N/m², N/m³."""
Point = Annotated[tuple[Finite, Finite], Field(strict=False)]

COLUMNS = (
    "eye_x", "eye_z", "pole_x", "pole_z", "linear", "unstretched", "damping", "square", "cubic",
)  # fmt: skip


class LineSettings(Table):
    """A line from an eye on the vessel to a pole.

    `eye`: x from the centre of gravity and height above still water (m); `pole`: distance from
    the wave maker and height above still water (m). `damping` acts on the rate of the stretch.
    """

    kind: str = "spring"
    stiffness: Positive
    pretension: NotNegative
    damping: NotNegative = 0.15
    eye: Point
    pole: Point

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in KINDS:
            raise ValueError(f"the kinds are {', '.join(KINDS)}.{did_you_mean(kind, KINDS)}")
        return kind

    @property
    def elasticity(self) -> Elasticity:
        """Coefficients of the tension's cubic in the stretch."""
        return KINDS[self.kind](self)

    @property
    def stretch(self) -> float:
        """Stretch at rest, under the pretension, m."""
        linear, square, cubic = self.elasticity
        if square == cubic == 0:
            return self.pretension / linear
        roots = np.roots([cubic, square, linear, -self.pretension])
        return float(min(roots.real[(abs(roots.imag) < 1e-9) & (roots.real >= 0)]))


KINDS: dict[str, Callable[[LineSettings], Elasticity]] = {
    "spring": lambda line: (line.stiffness, 0.0, 0.0)
}
"""The models of a line, by the word in the settings."""


def line_table(
    lines: Mapping[str, LineSettings], position: float, centre_of_gravity: float
) -> FloatArray:
    """Lines as rows of numbers for the time loop, columns as in ``COLUMNS``.

    Lengths count from the centre of gravity at rest: `position` from the wave maker, the other
    above still water.

    Raises
    ------
    RequestError
        If eye and pole coincide, or the pretension stretches a line beyond its length at rest.
    """
    table = np.zeros((len(lines), len(COLUMNS)))
    for row, (name, line) in zip(table, lines.items(), strict=True):
        eye = (line.eye[0], line.eye[1] - centre_of_gravity)
        pole = (line.pole[0] - position, line.pole[1] - centre_of_gravity)
        rest = float(np.hypot(line.pole[0] - position - line.eye[0], line.pole[1] - line.eye[1]))
        length = rest - line.stretch
        if length <= 0:
            raise RequestError(
                f"moorings.{name} has no length left: at rest eye and pole are {rest:.3f} m apart "
                f"and a pretension of {line.pretension:g} N stretches it by {line.stretch:.3f} "
                "m. Lower the pretension, stiffen the line, or move its pole."
            )
        linear, square, cubic = line.elasticity
        row[:] = [*eye, *pole, linear, length, line.damping, square, cubic]
    return table


def mooring_stiffness(table: FloatArray) -> FloatArray:
    """Stiffness and geometric stiffness of all taut lines at rest: surge, heave and pitch."""
    total = np.zeros((3, 3))
    for eye_x, eye_z, pole_x, pole_z, linear, unstretched, _, square, cubic in table:
        along = np.array([pole_x - eye_x, pole_z - eye_z])
        length = float(np.hypot(*along))
        stretch = length - unstretched
        if stretch <= 0:
            continue
        unit = along / length
        tension = ((cubic * stretch + square) * stretch + linear) * stretch
        slope = (3.0 * cubic * stretch + 2.0 * square) * stretch + linear
        local = slope * np.outer(unit, unit)
        local += tension / length * (np.eye(2) - np.outer(unit, unit))
        arm = np.array([[1.0, 0.0, eye_z], [0.0, 1.0, -eye_x]])
        total += arm.T @ local @ arm
        # A turned eye keeps its tension: its second derivative with pitch is minus the arm.
        total[2, 2] += tension * float(unit @ np.array([eye_x, eye_z]))
    return total
