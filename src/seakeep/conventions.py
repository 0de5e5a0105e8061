"""Canonical channels with their units and symbols, and the units that seakeep knows.

Inside seakeep everything is in SI units and radians; :func:`conversion` converts to them.
Frame: x along the direction in which the waves run, z up, angles right-handed about the axes
(a positive pitch lifts the bow, which points against the waves).
"""

import math
import re
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from typing import Any

from seakeep.arrays import Datasets, Groups, positive
from seakeep.errors import RequestError, did_you_mean

__all__ = [
    "MOTIONS",
    "TURNS",
    "Channel",
    "canonical_channel",
    "conversion",
    "displayed",
    "in_waves",
    "is_elevation",
    "si_unit",
]


@dataclass(frozen=True)
class Channel:
    """A canonical channel.

    Parameters
    ----------
    name : str
        Canonical name.
    units : str
        SI unit in which seakeep keeps it.
    long_name : str
        Name for labels.
    symbol : str
        Symbol of the paper, as matplotlib mathtext.
    """

    name: str
    units: str
    long_name: str
    symbol: str


MOTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
"""Motions of a rigid body, in the order of its six degrees of freedom."""
TURNS = MOTIONS[3:]
"""Those that are angles, about x, y and z."""
_QUANTITIES = {
    "surge": ("m", "surge", "x"),
    "sway": ("m", "sway", "y"),
    "heave": ("m", "heave", "z"),
    "roll": ("rad", "roll", r"\phi"),
    "pitch": ("rad", "pitch", r"\theta"),
    "yaw": ("rad", "yaw", r"\psi"),
    "eta": ("m", "wave elevation", r"\eta"),
    "mooring": ("N", "mooring load", "M"),
}
_DERIVATIVES = {
    "": ("", "{}"),
    "rate": ("/s", r"\dot{{{}}}"),
    "acceleration": ("/s^2", r"\ddot{{{}}}"),
}
_NAME = re.compile(
    rf"(?:({'|'.join(MOTIONS)})|(eta|mooring)(?:_([a-z0-9_]+?))??)(?:_(rate|acceleration))?\Z"
)


@cache
def canonical_channel(name: str) -> Channel | None:
    r"""Look a canonical channel up.

    Parameters
    ----------
    name : str
        Name of a channel.

    Returns
    -------
    Channel or None
        None for a free name.

    Examples
    --------
    >>> canonical_channel("pitch_rate")
    Channel(name='pitch_rate', units='rad/s', long_name='pitch rate', symbol='\\dot{\\theta}')
    >>> canonical_channel("eta_fwd").units
    'm'
    >>> canonical_channel("propeller_torque") is None
    True
    """
    if not (match := _NAME.match(name)):
        return None
    motion, quantity, place, suffix = (part or "" for part in match.groups())
    unit, words, letter = _QUANTITIES[motion or quantity]
    per, accent = _DERIVATIVES[suffix]
    place = place.replace("_", " ")
    label = f"{words} {place}".strip()
    if quantity == "mooring" and place in ("bow", "stern"):
        label = f"{place} {words}"
    symbol = accent.format(letter) + (rf"_\mathrm{{{place}}}" if place else "")
    return Channel(name, unit + per, f"{label} {suffix}".strip(), symbol)


def in_waves(runs: Datasets) -> Groups:
    """Runs that do not state still water."""
    return {name: run for name, run in runs.items() if run.attrs.get("waves") != "still"}


def is_elevation(name: str, rates: bool = False) -> bool:
    """Whether a channel is named as wave elevations are.

    Parameters
    ----------
    name : str
        Name of a channel.
    rates : bool, optional
        Whether the rates and accelerations of elevations count too.

    Returns
    -------
    bool
        True for ``eta`` and ``eta_…``.

    Examples
    --------
    >>> is_elevation("eta_fwd"), is_elevation("eta_fwd_rate"), is_elevation("etalon")
    (True, False, False)
    """
    known = canonical_channel(name)
    called = name == "eta" or name.startswith("eta_")
    return called and (rates or not known or known.units == "m")


def displayed(units: str) -> tuple[float, str]:
    """Factor and unit in which people are shown a channel: angles in degrees.

    Parameters
    ----------
    units : str
        SI unit of the channel.

    Returns
    -------
    (float, str)
        What its values are multiplied by, and the unit then.

    Examples
    --------
    >>> displayed("rad/s"), displayed("m")
    ((57.29577951308232, 'deg/s'), (1.0, 'm'))
    """
    if units == "rad" or units.startswith("rad/"):
        return math.degrees(1.0), units.replace("rad", "deg", 1)
    return 1.0, units


# The angle is a dimension of its own, so that degrees cannot pass for metres per metre.
_UNITS = """
hecto- = 1e2 = h-
centi- = 1e-2 = c-
milli- = 1e-3 = m-
micro- = 1e-6 = µ- = u-
kilo- = 1e3 = k-
mega- = 1e6 = M-
metre = [length] = m = meter = meters = metres
second = [time] = s = sec = secs = seconds
kilogram = [mass] = kg = kilograms
radian = [angle] = rad = radians
volt = [potential] = V = volts
kelvin = [temperature] = K
gram = 1e-3 * kilogram = g_mass = grams
inch = 0.0254 * metre = in = inches
foot = 0.3048 * metre = ft = feet
minute = 60 * second = min = minutes
hour = 3600 * second = h = hours
day = 86400 * second = d = days
degree = 0.017453292519943295 * radian = deg = ° = degrees
revolution = 6.283185307179586 * radian = rev = revolutions
rpm = revolution / minute
newton = kilogram * metre / second ** 2 = N = newtons
pascal = newton / metre ** 2 = Pa
bar = 1e5 * pascal
joule = newton * metre = J
newton_metre = newton * metre = Nm
watt = joule / second = W
hertz = 1 / second = Hz
tonne = 1e3 * kilogram = t = tonnes
standard_gravity = 9.80665 * metre / second ** 2 = g = gee = g0
kilogram_force = 9.80665 * newton = kgf
gram_force = 9.80665e-3 * newton = gf
tonne_force = 9806.65 * newton = tonf
pound_force = 4.4482216152605 * newton = lbf
knot = 0.5144444444444445 * metre / second = kn = knots = kt
percent = 0.01 = pct
"""


@cache
def _registry() -> Any:
    import pint  # here, because it takes a tenth of a second that not every command needs

    return pint.UnitRegistry(_UNITS.strip().splitlines())


_RAISED = str.maketrans("⁻¹²³⁴", "-1234")
_SIGNS = str.maketrans({"·": "*", "⋅": "*", "×": "*", "μ": "µ", "%": "percent"})
_SPELLINGS = {
    r"(?<=[A-Za-z°])(-?[1-9])": r"^\1",
    r"\^": "**",
    r"(?<=[A-Za-z°0-9])[ .-](?=[A-Za-z°])": "*",  # kN-m, as OpenFAST writes it
}


# A header is foreign text: powers of powers in it would keep the parser busy forever.
_PLAIN = re.compile(r"[\w°%.*/() +-]*\Z")
_POWER = re.compile(r"\*\*(?!\s*\(?-?\d\)?(?!\s*\*\*|\d))")


@cache
def _parsed(unit: str) -> Any:
    text = unit.strip().translate(_SIGNS)
    if text in ("", "-", "1", "none", "nondimensional", "dimensionless"):
        return _registry().dimensionless
    text = re.sub("[⁻¹²³⁴]+", lambda match: "^" + match[0].translate(_RAISED), text)
    for pattern, replacement in _SPELLINGS.items():
        text = re.sub(pattern, replacement, text)
    depths = accumulate((letter == "(") - (letter == ")") for letter in text)
    try:
        if len(text) > 80 or max(depths) > 2 or _POWER.search(text) or not _PLAIN.match(text):
            raise ValueError(text)
        return _registry().parse_units(text)
    except Exception as error:
        known = sorted({name for name in dir(_registry()) if not name.startswith("_")})
        raise RequestError(
            f"the unit {unit!r} is not known.{did_you_mean(unit, known)} Write it as 'mm', "
            "'deg/s', 'm/s^2', 'kN', 'g' (standard gravity), '-' (no unit) or, of times, 's', "
            "'ms', 'min', 'h' or 'd' (days), or convert the column and state an SI unit."
        ) from error


@cache
def si_unit(unit: str) -> str:
    """SI unit (radians for angles) of the same dimension as `unit`, in seakeep's spelling.

    Parameters
    ----------
    unit : str
        Any unit we understand: ``"mm"``, ``"deg/s"``, ``"m/s2"``, ``"kN"``, ``"-"`` …

    Returns
    -------
    str
        Its SI unit, ``"1"`` for a pure number.

    Raises
    ------
    RequestError
        If the unit is not known.

    Examples
    --------
    >>> si_unit("deg/s"), si_unit("kN"), si_unit("-")
    ('rad/s', 'N', '1')
    """
    known = ("m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "N", "N m", "Pa", "W", "Hz", "V")
    base, *bases = (_registry().get_base_units(_parsed(each))[1] for each in (unit, *known))
    if base in bases:
        return known[bases.index(base)]
    return f"{base:~C}".replace("**", "^").replace("*", " ") or "1"


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
    powers = {str(k): float(v) for k, v in _parsed(units).dimensionality.items()}
    length, time, mass = (powers.pop(f"[{name}]", 0.0) for name in ("length", "time", "mass"))
    if powers.keys() - {"[angle]"}:
        raise RequestError(
            f"the unit '{units}' is not mechanical, so Froude's law does not scale it. Convert "
            "the channel to a mechanical unit first, or leave it out."
        )
    return float(scale ** (length + 0.5 * time + 3.0 * mass) * density_ratio**mass)


def conversion(unit: str, target: str, channel: str = "the channel") -> float:
    """Factor that turns a value in `unit` into one in `target`.

    Parameters
    ----------
    unit : str
        Unit of the data.
    target : str
        Unit wanted.
    channel : str, optional
        Name for the message.

    Returns
    -------
    float
        The factor.

    Raises
    ------
    RequestError
        If a unit is not known, or the two measure different things.

    Examples
    --------
    >>> conversion("mm", "m"), round(conversion("deg/s", "rad/s"), 6)
    (0.001, 0.017453)
    """
    source, goal = _parsed(unit), _parsed(target)
    if source.dimensionality != goal.dimensionality:
        raise RequestError(
            f"the unit '{unit}' does not fit {channel}, which is measured in '{target}'. "
            "Correct the unit, or map the column to another channel."
        )
    return float(f"{_registry().convert(1.0, source, goal):.15g}")


def same_unit(one: str, other: str) -> bool:
    """Whether two texts say the same unit, however it is spelled."""
    try:
        return one == other or conversion(one, other) == 1.0
    except RequestError:  # one is not known, or they measure different things
        return False


def is_load(units: str) -> bool:
    """Whether a channel is a force, with or without a prefix, by its unit."""
    return units.endswith("N")
