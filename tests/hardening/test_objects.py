"""Functions and methods above those of arrays answer odd arguments in words of ours."""

import contextlib
import shutil
import warnings
import zlib

import pytest
import xarray as xr

pytest.importorskip("matplotlib")

import ground
import matplotlib.pyplot as plt
import numpy as np
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


UNSOUND = {
    "no coordinate 'time'": lambda run: run.drop_vars("time"),
    "no coordinate 'time'.": lambda run: run.rename(time="t"),
    "times of type datetime64": lambda run: run.assign_coords(
        time=np.datetime64("2026-01-01") + (1e9 * run["time"]).astype("timedelta64[ns]")
    ),
    "0 finite instant": lambda run: run.isel(time=slice(0, 0)),
    "1 finite instant": lambda run: run.isel(time=slice(0, 1)),
    "no channel 'eta_fwd'": lambda run: run.drop_vars("eta_fwd", errors="ignore"),
    "encounter_period = '1.5 s'": lambda run: run.assign_attrs(encounter_period="1.5 s"),
    "water_depth = 'deep'": lambda run: run.assign_attrs(water_depth="deep"),
    "train_span = 5.0": lambda run: run.assign_attrs(train_span=5.0),
    "'units' is no text": lambda run: run.assign(
        heave=run["heave"].assign_attrs(units=np.arange(2))
    ),
}
"""What hand-made runs lack, by what a message says of it."""


def test_runs_that_lack_something_are_answered(place, tmp_path):
    shutil.copytree(place, tmp_path / "g")
    fell, said = {}, set()
    with contextlib.chdir(tmp_path / "g"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, (call, given) in object_calls().items():
            for parameter, value in given.items():
                runs = value if isinstance(value, dict) else {"": value}
                if not all(isinstance(run, xr.Dataset) and "heave" in run for run in runs.values()):
                    continue
                for kind, spoil in UNSOUND.items():
                    bad = {key: spoil(run) for key, run in runs.items()}
                    spoiled = bad if isinstance(value, dict) else bad[""]
                    try:
                        call(**{**given, parameter: spoiled})
                    except SeakeepError as error:
                        said |= {each for each in UNSOUND if each in str(error)}
                    except Exception as error:
                        fell[f"{name} {parameter}: {kind}"] = f"{type(error).__name__}: {error}"
                    plt.close("all")
    assert fell == {}
    assert said == set(UNSOUND)
