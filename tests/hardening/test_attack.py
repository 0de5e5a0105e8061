"""Nothing breaks it: each case of the attack is answered, by a result or by an error of ours."""

import pytest

pytest.importorskip("resource", reason="limits of time and memory are POSIX")
pytest.importorskip("matplotlib")

import ground
from areas import AREAS
from attack import judged, sample

SAMPLED = {
    "settings": 1400, "texts": 25, "names": 90, "paths": 150, "options": 150, "contents": 900,
    "flips": 400, "arrays": 500, "sizes": 9,
}  # fmt: skip
"""One case of so many in the default run: some ten per area, in half a minute."""
PART = {"sizes": 1, "contents": 90}
"""One case of so many where the attack is asked for; 30 in other areas. Files take longest: each
case of a study draws its report anew."""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return ground.prepare(tmp_path_factory.mktemp("small"), whole=False)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return ground.prepare(tmp_path_factory.mktemp("whole"))


def fallen(area, place, every):
    cases = list(sample(AREAS[area](place), every))
    assert cases
    verdicts = {each.name: judged(each, place) for each in cases}
    return {name: each for name, each in verdicts.items() if not each.stands}


@pytest.mark.parametrize("area", AREAS)
def test_a_sample_of_the_attack_is_answered(area, small):
    assert fallen(area, small, SAMPLED[area]) == {}


@pytest.mark.hardening
@pytest.mark.parametrize("area", AREAS)
def test_the_attack_is_answered(area, whole):
    assert fallen(area, whole, PART.get(area, 30)) == {}
