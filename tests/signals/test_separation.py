"""Positions of wave probes against the waves: right ones pass, wrong ones are told."""

import numpy as np
import pytest
from near import assert_near
from said import request_error
from seas import sea

from seakeep.signals import misplaced_probes, probe_separation

DT, DEPTH = 0.05, 3.6
PLACES = {"fwd": 48.42, "mid": 50.2, "cog": 52.09}


def records_of(seed, places, *, length=210.0, band=(0.28, 1.13), reflected=0.0, noise=0.02):
    """Records of a sea at some places, with waves that come back."""
    rng, t = np.random.default_rng(seed), np.arange(0, length, DT)
    forth, back = sea(seed, band), sea(seed + 100, band)
    return {
        name: forth.at(t, x) + reflected * back.at(t, -x) + noise * rng.standard_normal(t.size)
        for name, x in places.items()
    }


def misplaced(records, places):
    return misplaced_probes(records, places, DT, DEPTH)


@pytest.mark.parametrize("stated", [3.67, 3.85, 1.0, -3.67, 40.0])
def test_the_separation_is_found_whatever_was_stated(stated):
    records = records_of(0, {"a": 0.0, "b": 3.67})
    found = probe_separation(records["a"], records["b"], DT, DEPTH, stated)
    # The taper and the time that the waves take leave 1 mm, the noise less.
    assert_near(found.separation, 3.67, 0.005)
    assert found.spread < 0.01
    assert found.correlation > 0.98
    assert found.disagrees is (stated != 3.67)


def test_a_long_record_is_sought_through_no_farther_than_is_affordable(monkeypatch):
    monkeypatch.setattr("seakeep.signals.propagation.MOST_PLACES", 200)  # some 7 m either way
    records = records_of(0, {"a": 0.0, "b": 5.0})
    found = probe_separation(records["a"], records["b"], DT, DEPTH, 0.5)
    assert_near(found.separation, 5.0, 0.005)  # as above


def test_the_error_of_a_carried_elevation_is_what_carrying_makes():
    records = records_of(1, {"a": 0.0, "b": 3.67, "wrong": 3.85}, noise=0.0)
    found = probe_separation(records["a"], records["b"], DT, DEPTH, 3.85)
    made = np.std(records["wrong"] - records["b"]) / np.std(records["b"])
    # The taper weighs parts of the record otherwise.
    assert found.input_error == pytest.approx(made, rel=0.05)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("conditions", [{}, {"reflected": 0.1}, {"noise": 0.2}, {"length": 60.0}])
def test_right_positions_pass_and_one_wrong_by_the_paper_s_is_named(seed, conditions):
    """Row 27 of the paper's notes: 0.18 m between what two places of the text call one."""
    records = records_of(seed, PLACES, **conditions)
    assert misplaced(records, PLACES) == []
    wrong = {**PLACES, "fwd": 48.24}
    (found,) = misplaced(records, wrong)
    assert (found.probe, found.certain) == ("fwd", True)
    # The probe stands 0.18 m nearer to the other one than stated; reflections leave 2 cm.
    assert_near(found.separation.separation - found.separation.stated, 0.18, 0.03)
    # 5 cm turn the mean wave, 4 m long, by 4 degrees: that does not matter.
    assert misplaced(records, {**PLACES, "fwd": 48.37}) == []
    assert misplaced(records, {"fwd": PLACES["cog"], "mid": PLACES["mid"], "cog": PLACES["fwd"]})
    (either,) = misplaced({name: records[name] for name in ("fwd", "cog")}, wrong)
    assert not either.certain


def test_waves_that_fit_no_distance_are_told_where_both_probes_recorded_them():
    """A wrong depth or sign; a sea in noise correlates as little, and is not doubted."""
    records = records_of(0, {"a": 0.0, "b": 3.67})
    for b, depth in ((records["b"], 0.4), (-records["b"], DEPTH)):
        found = probe_separation(records["a"], b, DT, depth, 3.67)
        assert (found.known, found.disagrees) == (False, True)
    for seed in range(5):
        records = records_of(seed, {"a": 0.0, "b": 3.67}, noise=0.6, reflected=0.1)
        found = probe_separation(records["a"], records["b"], DT, DEPTH, 3.67)
        assert (found.known, found.disagrees) == (False, False)


def test_what_says_nothing_of_positions_is_silent():
    wrong = {"fwd": 48.24, "cog": 52.09}
    right = {"fwd": 48.42, "cog": 52.09}
    regular = records_of(5, right, band=(0.599, 0.601))
    short = records_of(5, right, length=15.0)
    apart = {
        "fwd": records_of(6, {"fwd": 48.42})["fwd"],
        "cog": records_of(7, {"cog": 52.09})["cog"],
    }
    dead = {**records_of(5, {"fwd": 48.42}), "cog": np.zeros(4200)}
    for records in (regular, short, apart, dead):
        assert misplaced(records, wrong) == []
    wave = short["fwd"]
    with request_error(r"1e.06 m is too far .* Correct the positions"):
        probe_separation(wave, wave, DT, DEPTH, 1e6)
