r"""Froude's law: from model to full scale.

With the scale factor :math:`\lambda` (full-scale length over model length), gravity the same:
lengths go with :math:`\lambda`, times with :math:`\lambda^{1/2}`, masses with
:math:`r\,\lambda^3`, r the ratio of the water's densities; angles do not change.
"""

from __future__ import annotations

from seakeep.arrays import positive
from seakeep.conventions import base_powers
from seakeep.errors import RequestError


def froude_factor(units: str, scale: float, density_ratio: float = 1.0) -> float:
    """Factor from a model's value to the full-scale one.

    Parameters
    ----------
    units : str
        Unit of the value, such as ``"m/s^2"`` or ``"N"``.
    scale : float
        Scale factor, full-scale length over model length.
    density_ratio : float, optional
        Density of the sea over that of the basin's water; 1.025 from fresh to sea water.

    Returns
    -------
    float
        The factor.

    Raises
    ------
    RequestError
        If a number is not positive, or the unit is not mechanical.

    Examples
    --------
    >>> froude_factor("m", 50), round(froude_factor("s", 50), 3), froude_factor("N", 50)
    (50.0, 7.071, 125000.0)
    >>> froude_factor("m/s^2", 50), round(froude_factor("rad/s", 50), 4)
    (1.0, 0.1414)
    """
    positive(scale, "the scale factor", "a ratio")
    positive(density_ratio, "the density ratio", "a ratio")
    length, time, mass, others = base_powers(units)
    if others:
        raise RequestError(
            f"the unit '{units}' is not mechanical, so Froude's law does not scale it. Convert "
            "the channel to a mechanical unit first, or leave it out."
        )
    return float(scale ** (length + 0.5 * time + 3.0 * mass) * density_ratio**mass)
