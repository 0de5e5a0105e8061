"""The logic of the ROS 2 example: which samples become which step, without ROS."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from seakeep import HankelDMDc

EXAMPLE = Path(__file__).parents[2] / "examples/ros2_node"
DT = 0.05
CLOCK = 1.7e9  # seconds since 1970, as ROS counts them


def loaded(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLE / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def follower_class():
    return loaded("follower").Follower


@pytest.fixture
def model(make_run, channels):
    return HankelDMDc(3, 8, 1.0, delay_rows="exact").fit(make_run(), **channels)


def play(follower, run, samples, lost=(), jitter=0.0, seed=0):
    """Feed samples of a run as messages, and collect the estimates."""
    rng, found = np.random.default_rng(seed), []
    for sample in samples:
        for channel in [*follower.model.inputs, *follower.model.states]:
            if (channel, sample) not in lost:
                stamp = CLOCK + sample * DT + jitter * DT * rng.uniform(-0.45, 0.45)
                follower.receive(channel, stamp, float(run[channel].values[sample]))
        found += follower.advance(CLOCK + (sample + 0.6) * DT)
    return found


def test_complete_samples_are_the_steps_of_the_live_model(follower_class, model, make_run):
    run, expected = make_run(seed=5), model.live()
    found = play(follower_class(model), run, range(60))
    for sample, (instant, state) in enumerate(found):
        u, y = ([run[name].values[sample] for name in of] for of in (model.inputs, model.states))
        np.testing.assert_array_equal(state, expected.step(u, y))
        assert instant == pytest.approx(CLOCK + sample * DT, abs=1e-3)
    assert len(found) == 60


def test_stamps_between_instants_go_to_the_nearest(follower_class, model, make_run):
    run = make_run(seed=5)
    exact = play(follower_class(model), run, range(60))
    follower = follower_class(model)
    first = play(follower, run, range(1))  # sets the grid
    shifted = first + play(follower, run, range(1, 60), jitter=1.0)
    np.testing.assert_array_equal([s for _, s in shifted], [s for _, s in exact])


def test_lost_messages_are_estimated_and_late_ones_left_out(follower_class, model, make_run):
    run = make_run(seed=5)
    lost = {("eta_fwd", 40), ("heave", 41), ("heave", 42), ("pitch", 42)}
    follower = follower_class(model)
    found = play(follower, run, range(60), lost)
    assert len(found) == 60
    assert np.all(np.isfinite([state for _, state in found]))
    measured = np.stack([run[name].values[:60] for name in model.states], axis=1)
    differs = np.any(np.array([state for _, state in found]) != measured, axis=1)
    assert set(np.flatnonzero(differs)) == {41, 42}
    follower.receive("heave", CLOCK + 42 * DT, 1e3)
    assert not follower.waiting["heave"]


def test_it_waits_for_all_inputs_and_starts_anew_after_a_long_gap(follower_class, model, make_run):
    run, follower = make_run(seed=5), follower_class(model, longest=2.0)
    assert play(follower, run, range(10), {("eta_cog", each) for each in range(10)}) == []
    assert len(play(follower, run, range(10, 30))) == 20
    assert follower.advance(CLOCK + 30 * DT + 2.5) == []
    assert np.isnan(follower.live.time)
    assert len(play(follower, run, range(100, 120))) == 20


def test_it_continues_from_a_state(follower_class, model, make_run):
    run = make_run(seed=5)
    whole, first = follower_class(model), follower_class(model)
    expected = play(whole, run, range(60))[40:]
    play(first, run, range(40))
    found = play(follower_class(model, first.live), run, range(40, 60))
    np.testing.assert_array_equal([s for _, s in found], [s for _, s in expected])


def test_the_node_is_sound_python():
    compile((EXAMPLE / "node.py").read_text("utf-8"), "node.py", "exec")
