"""A wave probe whose unit, sign or gain one run alone has is found beside the other probes."""

import numpy as np
import pytest
from records import record
from seas import sea

from seakeep.quality import findings_of, judge_runs
from seakeep.quality.runs import odd_probes

T = np.arange(0, 160, 0.1)
SEAS = {"low": 1.6, "middle": 1.9, "high": 2.3, "last": 2.1}
PLACES = {"eta_fwd": 0.0, "eta_mid": 3.0, "eta_aft": 4.5}


def campaign(probes=2, seconds=160, regular=False, **faults):
    """Runs in four seas before a wall that reflects a third; by run, a factor on one probe."""
    runs = {}
    for seed, (name, peak) in enumerate(SEAS.items()):
        waves = sea(seed, peak=peak, components=1 if regular else 100)
        noise = np.random.default_rng(seed).normal(0, 0.02, (3, T.size))
        eta = {
            probe: waves.at(T, x) + waves.at(T, 12.0 - x) / 3 + noise[k]
            for k, (probe, x) in enumerate(list(PLACES.items())[:probes])
        }
        eta["eta_fwd"] *= faults.get(name, 1.0)
        runs[name] = record(0.1, {"waves": "regular"} if regular else {}, **eta)
        runs[name] = runs[name].isel(time=slice(10 * seconds))
    return runs


def odd(**keys):
    return {(each.run, each.channel): each.value for each in odd_probes(campaign(**keys))}


def test_nothing_is_said_of_other_seas_before_a_wall_and_of_small_changes():
    assert odd() == odd(probes=3) == odd(regular=True) == odd(seconds=30) == odd(high=1.1) == {}


@pytest.mark.parametrize("factor", [0.001, -1.0, 0.75, 1000.0])
def test_another_unit_sign_or_gain(factor):
    # Of two, either may be wrong.
    assert odd(high=factor) == {("high", "eta_mid"): pytest.approx(1 / factor, rel=0.1)}


def test_of_three_probes_the_one_that_moves_otherwise_is_named():
    assert odd(probes=3, high=-0.5) == {("high", "eta_fwd"): pytest.approx(-0.5, rel=0.1)}


@pytest.mark.parametrize("keys", [{"regular": True}, {"seconds": 30}])
def test_regular_and_short_runs_are_judged_by_large_factors_alone(keys):
    assert odd(high=1.5, **keys) == {}
    assert list(odd(high=0.001, **keys)) == [("high", "eta_mid")]


def test_still_water_says_nothing():
    runs = campaign(high=0.001)
    runs["high"].attrs["waves"] = "still"
    assert list(odd_probes(runs)) == []


def test_findings_are_taken_back_once_the_file_is_repaired():
    runs = campaign(high=0.001)
    with pytest.warns(match=r"^high: eta_mid moves .* beside eta_fwd as in most other runs\."):
        judge_runs(runs)
    runs["high"]["eta_fwd"] *= 1000.0
    assert judge_runs(runs) == ["high"]
    assert findings_of(runs["high"]) == []
