"""Channels and units."""

import math

import pytest
from said import request_error

from seakeep.conventions import canonical_channel, conversion, is_elevation, si_unit

UNITS = {
    "m": {"m": 1.0, "mm": 1e-3, "in": 0.0254},
    "rad": {"deg": math.pi / 180},
    "rad/s": {"rad s-1": 1.0, "rev/min": 2 * math.pi / 60},
    "rad/s^2": {"°/s²": math.pi / 180},
    "m/s": {"kn": 0.5144444444444445, "km/h": 1 / 3.6},
    "m/s^2": {"m/s2": 1.0, "m s^-2": 1.0, "m·s⁻²": 1.0, "g": 9.80665},
    "kg/m^3": {"kg m⁻³": 1.0},
    "N": {"kN": 1e3, "lbf": 4.4482216152605},
    "N m": {"Nm": 1.0, "kN m": 1e3, "kN-m": 1e3},
    "Pa": {"hPa": 1e2},
    "s": {"ms": 1e-3, "day": 86400.0},
    "1": {"%": 1e-2, "-": 1.0, "": 1.0},
}


@pytest.mark.parametrize("si", UNITS)
def test_units(si):
    for unit, factor in UNITS[si].items():
        assert si_unit(unit) == si
        # conversion() rounds to 15 digits, so that 1 mm is 0.001 m.
        assert conversion(unit, si) == pytest.approx(factor, rel=1e-14)


def test_families_of_channels():
    assert canonical_channel("eta_fwd").long_name == "wave elevation fwd"
    assert canonical_channel("mooring_port").units == "N"
    assert canonical_channel("mooring_bow").long_name == "bow mooring load"
    assert canonical_channel("heave_fwd") is None
    assert canonical_channel("mooring_bow_rate").units == "N/s"
    assert canonical_channel("mooring_aft_port_acceleration").units == "N/s^2"
    assert canonical_channel("eta_rate").symbol == r"\dot{\eta}"
    assert canonical_channel("Eta") is None


def test_elevations_and_their_rates_are_known_by_name():
    names = ["eta", "eta_fwd", "eta_fwd_rate", "eta_rate", "etalon", "heave"]
    assert list(filter(is_elevation, names)) == names[:2]
    assert [name for name in names if is_elevation(name, rates=True)] == names[:4]


def test_an_angle_is_no_number():
    with request_error("does not fit the channel"):
        conversion("-", "rad")
