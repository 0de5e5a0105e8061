"""Nothing breaks it: each case of the attack is answered, by a result or by an error of ours."""

import re

import pytest

pytest.importorskip("resource", reason="limits of time and memory are POSIX")
pytest.importorskip("matplotlib")

import ground
import xarray as xr
from areas import AREAS, MODELS, mutations, spoiled
from attack import judged, sample

from seakeep.errors import SeakeepError
from seakeep.models import KINDS, store

SAMPLED = {
    "settings": 1400, "texts": 25, "names": 90, "paths": 150, "options": 401, "contents": 1100,
    "flips": 400, "arrays": 500, "sizes": 9,
}  # fmt: skip
"""One case of so many in the default run: some ten per area, in half a minute."""
PART = {"sizes": 1, "contents": 220, "settings": 40}
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


PYTHONS = re.compile(
    r"object|argument|subscript|unhashable|convert|attribute|unpack|invalid literal|indices|len\(\)"
    r"|must be real|Expecting|Exceeds|inhomogeneous|broadcast|dtype\(|ufunc|unexpected|recursion"
)
"""Words of Python and NumPy, which tell nobody what to mend."""


def refusals(cases):
    """What is said to the cases that are refused; those that are taken say nothing."""
    words = {}
    for case in cases:
        try:
            case.call()
        except SeakeepError as error:
            words[case.name] = str(error)
    return words


@pytest.mark.hardening
@pytest.mark.parametrize("name", MODELS)
def test_whatever_a_model_file_holds_is_taken_or_named(name, whole):
    with xr.open_dataset(whole / f"{name}.nc", engine="h5netcdf") as opened:
        kept = opened.load()

    def load(**how):
        made = spoiled(kept, **how)
        store.rebuilt("m.nc", lambda: KINDS[kept.attrs["seakeep_kind"]].restore(made))

    cases = mutations("contents", name, dict(kept.attrs), list(kept.variables), load)
    words = refusals(cases)
    assert len(words) > 400
    assert {each: said for each, said in words.items() if PYTHONS.search(said)} == {}
