"""Runs that a model of all runs does not serve, and what sets them apart."""

from dataclasses import replace

import numpy as np
import pytest
from drifting import drifting_run, drifting_runs
from near import assert_near
from numpy.testing import assert_allclose
from records import record
from scipy import signal
from seas import sea

from seakeep import HankelDMDc
from seakeep.baselines import ARX
from seakeep.models.conditions import Disagreement, disagreements

DT, CHANNELS = 0.1, (["heave", "pitch"], ["eta"])
SPEC = HankelDMDc(6, 20, 1e-2, delay_rows="exact", ridge_scale="per_snapshot")


def vessel(seed, stiffness=0.16, factor=1.0, offset=0.0, zero=0.0):
    """Heave and pitch of oscillators in irregular waves; heave is measured with another scale."""
    rng = np.random.default_rng(seed)
    time = DT * np.arange(1200)
    eta = 0.4 * sea(seed, (0.5, 1.1), components=30).at(time)
    heave = signal.lfilter([0.0, stiffness], [1.0, stiffness - 1.75, 0.75], eta)
    pitch = signal.lfilter([0.0, 0.0, 0.1], [1.0, -1.6, 0.75], eta)
    channels = {"heave": factor * heave + offset, "pitch": pitch, "eta": eta + zero}
    for x in channels.values():
        x += 0.01 * x.std() * rng.standard_normal(time.size)
    return record(DT, {"encounter_period": 1.25}, **channels)


def found(last, spec=SPEC, **attrs):
    runs = {"a": vessel(1), "b": vessel(2), "c": vessel(3), "odd": vessel(4, **last)}
    runs = {name: run.assign_attrs(attrs) for name, run in runs.items()}
    return disagreements(spec, runs, *CHANNELS)


def test_runs_of_one_condition_agree_and_one_alone_has_nothing_to_disagree_with():
    assert found({}) == []
    assert disagreements(SPEC, {"a": vessel(1)}, ["heave"], ["eta"]) == []


@pytest.mark.parametrize(
    ("last", "reason", "channel", "value"),
    [
        ({"offset": 0.5}, "offset", "heave", 0.5),
        ({"factor": 1.8}, "scale", "heave", 1.8),
        ({"stiffness": 0.6}, "dynamics", "", np.nan),
    ],
)
def test_a_run_of_another_condition_is_named_with_what_sets_it_apart(last, reason, channel, value):
    (each,) = found(last)
    assert each.run == "odd"
    assert (each.reason, each.channel) == (reason, channel)
    assert each.own < 0.8 * each.pooled
    # Estimated from a minute of free runs, by a model of noisy data.
    assert_allclose(each.value, value, rtol=0.1)
    assert "odd disagrees with the other runs: " in each.describe()
    assert ("set centre = 'run' in [model]" in each.describe()) == (reason == "offset")
    assert each.units == ("m" if channel else "")
    # These runs state no water depth.
    assert "of a probe explains it" not in each.describe()
    assert ("water_depth in [rig]" in each.describe()) == (reason == "dynamics")


@pytest.mark.parametrize(
    ("channel", "units", "text", "drifts"),
    [
        ("surge", "m", "surge lies +0.5 m off", True),
        ("yaw", "rad", "yaw lies +28.6 deg off", True),
        ("mooring_bow", "N", "mooring_bow lies +0.5 N off", True),
        ("heave", "m", "heave lies +0.5 m off", False),
    ],
)
def test_an_offset_of_what_is_moored_may_be_drift(channel, units, text, drifts):
    told = Disagreement("odd", 1.0, 0.5, "offset", channel, 0.5, units=units).describe()
    assert text in told
    assert ("may be real drift" in told) == drifts
    assert ("Else correct its zero" in told) == drifts


def test_another_unit_of_a_load_moves_its_mean_too():
    """In kgf in one run, the load's mean and its motion make up the error together, not alone."""
    mean = float(vessel(4)["heave"].std())
    runs = {name: vessel(seed, offset=mean) for seed, name in enumerate("abc", 1)}
    runs["odd"] = vessel(4, factor=1 / 9.81, offset=mean / 9.81)
    # A model of another kind may be asked as well.
    (each,) = disagreements(ARX(6, 20, 1e-2, ridge_scale="per_snapshot"), runs, *CHANNELS)
    assert (each.run, each.reason, each.channel) == ("odd", "scale", "heave")
    assert_allclose(each.value, 1 / 9.81, rtol=0.1)


def test_of_two_runs_either_may_be_wrong():
    (each,) = disagreements(SPEC, {"p1": vessel(1), "p2": vessel(4, offset=0.5)}, *CHANNELS)
    text = "p1 and p2 disagree; which one is wrong, these data do not say"
    assert sorted((each.run, each.rival)) == ["p1", "p2"]
    assert text in each.describe() or text.replace("p1 and p2", "p2 and p1") in each.describe()
    assert "other runs" not in each.describe()


def test_an_input_in_whose_range_no_other_run_lies_is_named_first():
    (each,) = disagreements(SPEC, {"p1": vessel(1), "p2": vessel(4, zero=1.5)}, *CHANNELS)
    zero = 1.5 if each.run == "p2" else 0.0
    assert (each.reason, each.channel) == ("input", "eta")
    assert_allclose(each.value, zero, atol=0.02)  # a twentieth of the waves' SD


def test_an_offset_is_named_also_for_a_model_with_a_memory():
    offset = 1.3 * float(vessel(4)["heave"].std())
    # Eight periods, whose means learn the offset of each run.
    (each,) = found({"offset": offset}, replace(SPEC, memory=100))
    assert (each.run, each.reason, each.channel) == ("odd", "offset", "heave")
    # Estimated from a minute of free runs, by a model of noisy data.
    assert_allclose(each.value, offset, rtol=0.1)


def test_a_probe_that_was_moved_is_found_with_its_distance():
    runs = drifting_runs(3)
    runs["moved"] = drifting_run(4, moved=1.5)
    spec = HankelDMDc(10, 40, 1e-4, delay_rows="exact", ridge_scale="per_snapshot")
    (moved,) = disagreements(spec, runs, ["heave"], ["eta_fwd", "eta_cog"])
    assert (moved.run, moved.reason) == ("moved", "probe position")
    # What is recorded downstream of where the probe is said to stand is carried back.
    assert_near(moved.value, -1.5, max(3 * moved.spread, 0.2))
    assert f"Set probe_offset = {moved.value:.3g} in [runs.moved]" in moved.describe()
    assert 'alignment = { mode = "dispersion", surge = "none" } in [model]' in moved.describe()


def test_the_place_of_a_probe_explains_no_other_dynamics_where_the_depth_is_stated():
    (each,) = found({"stiffness": 0.6}, water_depth=np.inf)
    assert "no offset, scale or place of a probe explains it" in each.describe()
