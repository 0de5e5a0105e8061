"""Bad input is answered: each case ends in a result, or in an error of ours."""

import zlib

import pytest

pytest.importorskip("resource", reason="limits of time and memory are POSIX")
pytest.importorskip("matplotlib")

import ground
from areas import AREAS
from attack import fall

EVERY = {"settings": 80, "paths": 8, "options": 20, "flips": 8}
"""One case of so many where the attack is asked for."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return ground.prepare(tmp_path_factory.mktemp("whole"))


def test_every_area_has_cases():
    """They are made from the classes of the settings and the options of the commands."""
    assert [area for area, cases in AREAS.items() if len(list(cases())) < 50] == []


@pytest.mark.hardening
@pytest.mark.parametrize("area", AREAS)
def test_the_attack_is_answered(area, place):
    taken = [
        (name, call)
        for name, call in AREAS[area]()
        if zlib.crc32(f"{area} {name}".encode()) % EVERY[area] == 0
    ]
    fallen = {name: words for name, call in taken if (words := fall(call, place))}
    assert fallen == {}
