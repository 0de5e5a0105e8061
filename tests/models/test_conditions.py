"""Runs that a model of all runs does not serve, and what sets them apart."""

import numpy as np
import pytest
import xarray as xr
from drifting import drifting_run

from seakeep import HankelDMDc
from seakeep.models.conditions import disagreements

DT = 0.1
SPEC = HankelDMDc(6, 20, 1e-2, delay_rows="exact", ridge_scale="per_snapshot")


def vessel(seed, stiffness=0.16, factor=1.0, offset=0.0, samples=1200):
    """Heave and pitch of oscillators in irregular waves; heave is measured with another scale."""
    rng = np.random.default_rng(seed)
    time = DT * np.arange(samples)
    omega = 2 * np.pi * rng.uniform(0.5, 1.1, 30)
    eta = np.cos(np.outer(time, omega) + rng.uniform(0, 2 * np.pi, 30)).sum(axis=1) / 10
    heave, pitch = np.zeros((2, samples))
    for k in range(1, samples - 1):
        heave[k + 1] = (1.75 - stiffness) * heave[k] - 0.75 * heave[k - 1] + stiffness * eta[k]
        pitch[k + 1] = 1.6 * pitch[k] - 0.75 * pitch[k - 1] + 0.1 * eta[k - 1]
    channels = {"heave": factor * heave + offset, "pitch": pitch, "eta": eta}
    return xr.Dataset(
        {
            name: ("time", x + 0.01 * x.std() * rng.standard_normal(samples), {"units": "m"})
            for name, x in channels.items()
        },
        coords={"time": time},
        attrs={"encounter_period": 1.25},
    )


def found(last, states=("heave", "pitch"), **more):
    runs = {"a": vessel(1), "b": vessel(2), "c": vessel(3), "odd": vessel(4, **last)}
    return {each.run: each for each in disagreements(SPEC, runs | more, [*states], ["eta"])}


def test_runs_of_one_condition_agree_and_one_alone_has_nothing_to_disagree_with():
    assert found({}) == {}
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
    (each,) = found(last).values()
    assert each.run == "odd"
    assert (each.reason, each.channel) == (reason, channel)
    assert each.own < 0.8 * each.pooled
    # Estimated from a minute of free runs, by a model of noisy data.
    np.testing.assert_allclose(each.value, value, rtol=0.1)
    assert "odd disagrees with the other runs" in each.describe()


def test_a_probe_that_was_moved_is_found_with_its_distance():
    runs = {f"run{seed}": drifting_run(seed) for seed in (1, 2, 3)}
    runs["moved"] = drifting_run(4, moved=1.5)
    spec = HankelDMDc(10, 40, 1e-4, delay_rows="exact", ridge_scale="per_snapshot")
    (moved,) = disagreements(spec, runs, ["heave"], ["eta_fwd", "eta_cog"])
    assert (moved.run, moved.reason) == ("moved", "probe position")
    # What is recorded downstream of where the probe is said to stand is carried back.
    assert moved.value == pytest.approx(-1.5, abs=max(3 * moved.spread, 0.2))
    assert f"Set probe_offset = {moved.value:.3g} in [runs.moved]" in moved.describe()
