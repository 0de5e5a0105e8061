"""Channels and units."""

import math

import pytest

from seakeep.conventions import MOTIONS, canonical_channel, conversion, is_elevation, si_unit
from seakeep.errors import RequestError


@pytest.mark.parametrize(
    ("unit", "si", "factor"),
    [
        ("m", "m", 1.0),
        ("mm", "m", 1e-3),
        ("in", "m", 0.0254),
        ("deg", "rad", math.pi / 180),
        ("°/s²", "rad/s^2", math.pi / 180),
        ("rad s-1", "rad/s", 1.0),
        ("rev/min", "rad/s", 2 * math.pi / 60),
        ("m/s2", "m/s^2", 1.0),
        ("m s^-2", "m/s^2", 1.0),
        ("m·s⁻²", "m/s^2", 1.0),
        ("kg m⁻³", "kg/m^3", 1.0),
        ("g", "m/s^2", 9.80665),
        ("kn", "m/s", 0.5144444444444445),
        ("km/h", "m/s", 1 / 3.6),
        ("kN", "N", 1e3),
        ("lbf", "N", 4.4482216152605),
        ("Nm", "N m", 1.0),
        ("kN m", "N m", 1e3),
        ("hPa", "Pa", 1e2),
        ("ms", "s", 1e-3),
        ("%", "1", 1e-2),
        ("-", "1", 1.0),
        ("", "1", 1.0),
    ],
)
def test_units(unit, si, factor):
    assert si_unit(unit) == si
    # conversion() rounds to 15 digits, so that 1 mm is 0.001 m.
    assert conversion(unit, si) == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize("kind", ["", "_rate", "_acceleration"])
@pytest.mark.parametrize("quantity", [*MOTIONS, "eta"])
def test_every_canonical_unit_is_si(quantity, kind):
    name = quantity + kind
    channel = canonical_channel(name)
    assert si_unit(channel.units) == channel.units
    assert conversion(channel.units, channel.units) == 1.0
    assert channel.name == name
    assert channel.long_name


def test_families_of_channels():
    assert canonical_channel("eta_fwd").long_name == "wave elevation fwd"
    assert canonical_channel("mooring_port").units == "N"
    assert canonical_channel("mooring_bow").long_name == "bow mooring load"
    assert canonical_channel("heave_fwd") is None
    assert canonical_channel("mooring_bow_rate").units == "N/s"
    assert canonical_channel("mooring_aft_port_acceleration").units == "N/s^2"
    assert canonical_channel("eta_rate").symbol == r"\dot{\eta}"
    assert canonical_channel("Eta") is None


@pytest.mark.parametrize(
    ("name", "elevation", "rate"),
    [
        ("eta", True, False),
        ("eta_fwd", True, False),
        ("eta_fwd_rate", False, True),
        ("eta_rate", False, True),
        ("etalon", False, False),
        ("heave", False, False),
    ],
)
def test_elevations_and_their_rates_are_known_by_name(name, elevation, rate):
    assert is_elevation(name) == elevation
    assert is_elevation(name, rates=True) == (elevation or rate)


def test_an_angle_is_no_number_and_no_length():
    with pytest.raises(
        RequestError,
        match=r"the unit 'mm' does not fit pitch, which is measured in 'rad'\. Correct the unit",
    ):
        conversion("mm", "rad", "pitch")
    with pytest.raises(RequestError, match="does not fit the channel"):
        conversion("-", "rad")
