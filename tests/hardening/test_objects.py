"""Functions and methods above those of arrays answer odd arguments in words of ours."""

import contextlib
import shutil
import warnings
import zlib

import pytest

pytest.importorskip("matplotlib")

import ground
import matplotlib.pyplot as plt
from object_calls import object_calls
from odd_values import ODD

from seakeep.errors import SeakeepError

SAMPLED, PART = 40, 3
"""One odd argument of so many: in the default run, and where the attack is asked for."""
OWN = ("progress", "members")
"""Arguments that are functions of the user's own, with errors of their own."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return ground.prepare(tmp_path_factory.mktemp("objects"), whole=False)


def fallen(place, folder, every):
    """Odd arguments that end in an error of Python, of one in so many."""
    shutil.copytree(place, folder / "g")
    fell, tried = {}, 0
    with contextlib.chdir(folder / "g"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, (call, given) in object_calls().items():
            for parameter in given:
                for kind, value in ODD.items():
                    case = f"{name} {parameter} = {kind}"
                    if zlib.crc32(case.encode()) % every or (parameter in OWN and kind == "class"):
                        continue
                    tried += 1
                    try:
                        call(**{**given, parameter: value})
                    except SeakeepError:
                        pass
                    except Exception as error:
                        fell[case] = f"{type(error).__name__}: {error}"[:100]
                    plt.close("all")
    return fell, tried


def test_a_sample_of_odd_arguments_is_answered(place, tmp_path):
    fell, tried = fallen(place, tmp_path, SAMPLED)
    assert tried > 200
    assert fell == {}


@pytest.mark.hardening
def test_odd_arguments_are_answered(place, tmp_path):
    fell, tried = fallen(place, tmp_path, PART)
    assert tried > 3000
    assert fell == {}
