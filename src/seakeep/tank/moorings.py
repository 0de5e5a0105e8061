"""Elastic mooring lines that only pull: geometry, stiffness at rest, slack limit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from seakeep.errors import RequestError
from seakeep.tank.settings import LineSettings

__all__ = ["line_table", "mooring_stiffness", "unstretched_length"]

FloatArray = npt.NDArray[np.float64]

COLUMNS = ("eye_x", "eye_z", "pole_x", "pole_z", "stiffness", "unstretched", "damping")


def unstretched_length(name: str, line: LineSettings, position: float) -> float:
    """Length of a line without load, m.

    Parameters
    ----------
    name : str
        Name of the line, for messages.
    line : LineSettings
        The line.
    position : float
        Distance of the vessel's centre of gravity from the wave maker at rest, m.

    Returns
    -------
    float
        The length at rest less pretension over stiffness.

    Raises
    ------
    RequestError
        If eye and pole coincide, or the pretension stretches the line beyond its length at rest.
    """
    rest = float(np.hypot(line.pole[0] - position - line.eye[0], line.pole[1] - line.eye[1]))
    length = rest - line.pretension / line.stiffness
    if length <= 0:
        raise RequestError(
            f"moorings.{name} has no length left: at rest eye and pole are {rest:.3f} m apart and "
            f"a pretension of {line.pretension:g} N stretches it by "
            f"{line.pretension / line.stiffness:.3f} m. Lower the pretension, stiffen the line, or "
            "move its pole."
        )
    return length


def line_table(
    lines: Mapping[str, LineSettings], position: float, centre_of_gravity: float
) -> FloatArray:
    """Lines as rows of numbers for the time loop.

    Parameters
    ----------
    lines : mapping of str to LineSettings
        The lines.
    position : float
        Distance of the centre of gravity from the wave maker at rest, m.
    centre_of_gravity : float
        Its height above still water, m.

    Returns
    -------
    ndarray, shape (line, 7)
        Columns as in ``COLUMNS``; positions from the centre of gravity at rest.
    """
    rows = [
        (
            line.eye[0],
            line.eye[1] - centre_of_gravity,
            line.pole[0] - position,
            line.pole[1] - centre_of_gravity,
            line.stiffness,
            unstretched_length(name, line, position),
            line.damping,
        )
        for name, line in lines.items()
    ]
    return np.array(rows, dtype=float).reshape(-1, len(COLUMNS))


def mooring_stiffness(table: FloatArray) -> FloatArray:
    """Stiffness and geometric stiffness of all taut lines at rest.

    Parameters
    ----------
    table : ndarray, shape (line, 7)
        From :func:`line_table`.

    Returns
    -------
    ndarray, shape (3, 3)
        Restoring of surge, heave and pitch.
    """
    total = np.zeros((3, 3))
    for eye_x, eye_z, pole_x, pole_z, stiffness, unstretched, _ in table:
        along = np.array([pole_x - eye_x, pole_z - eye_z])
        length = float(np.hypot(*along))
        if length <= unstretched:
            continue
        unit = along / length
        tension = stiffness * (length - unstretched)
        local = stiffness * np.outer(unit, unit)
        local += tension / length * (np.eye(2) - np.outer(unit, unit))
        arm = np.array([[1.0, 0.0, eye_z], [0.0, 1.0, -eye_x]])
        total += arm.T @ local @ arm
        # A turned eye keeps its tension: its second derivative with pitch is minus the arm.
        total[2, 2] += tension * float(unit @ np.array([eye_x, eye_z]))
    return total
