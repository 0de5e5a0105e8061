"""Read-outs with hinges: a line that falls slack."""

import numpy as np
import pytest

from seakeep.core.readouts import KNOTS, fit_hinges, floor_of, hinges, knots_of


def states_and_load(seed: int = 0, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Surge and heave, and the load of a line that is taut where the surge exceeds 0.2."""
    rng = np.random.default_rng(seed)
    states = rng.normal(size=(4000, 2))
    load = np.maximum(0.0, 2.0 * (states[:, 0] - 0.2)) + 0.3 * states[:, 1]
    return states, load + noise * rng.normal(size=len(load))


def test_a_hinge_bends_at_its_knot():
    knots = np.array([[0.0, 1.0]])
    found = hinges(np.array([[-1.0, 5.0], [0.5, 5.0], [3.0, 5.0]]), [0], knots)
    np.testing.assert_array_equal(found, [[0, 0], [0.5, 0], [3.0, 2.0]])


def test_a_function_that_is_linear_between_the_knots_is_recovered():
    states, _ = states_and_load()
    knots = knots_of(states, [0])
    assert knots.shape == (1, KNOTS)
    target = 1.5 + 0.7 * states[:, 1] + np.maximum(0, states[:, 0] - knots[0, 2])
    fitted = fit_hinges(states, target, [0, 1], [0], knots, ridge=1e-12, floor=-np.inf)
    # λ moves the weights by about λ times their size over the least variance of a feature.
    np.testing.assert_allclose(fitted(states), target, atol=1e-8)


def test_a_slack_line_is_followed_far_better_than_by_a_linear_map():
    states, load = states_and_load(noise=0.02)
    knots = knots_of(states, [0])
    bent = fit_hinges(states, load, [0, 1], [0], knots, ridge=1e-6, floor=-np.inf)
    gram = np.c_[np.ones(len(states)), states]
    linear = gram @ np.linalg.lstsq(gram, load, rcond=None)[0]
    errors = [np.sqrt(np.mean((each - load) ** 2)) for each in (bent(states), linear)]
    # The kink at 0.2 lies between two knots half a standard deviation apart.
    assert errors[0] < 0.08
    assert errors[0] < 0.2 * errors[1]


def test_a_load_never_falls_below_its_floor():
    states, load = states_and_load()
    fitted = fit_hinges(states, load, [0, 1], [0], knots_of(states, [0]), 1e-6, floor=-0.1)
    assert fitted(10 * states).min() == pytest.approx(-0.1)


def test_a_constant_is_not_regularised():
    states, _ = states_and_load()
    target = np.full(len(states), 7.0)
    fitted = fit_hinges(states, target, [0], [], np.empty((0, KNOTS)), ridge=1e6, floor=-np.inf)
    np.testing.assert_allclose(fitted(states[:5]), 7.0, rtol=1e-12)  # rounding of a mean


@pytest.mark.parametrize("taut", [0.5, 0.8, 0.98])
def test_a_floor_is_found_where_a_line_rests_on_it(taut):
    rng = np.random.default_rng(3)
    states = rng.normal(size=(4000, 2))
    pull = 2.0 * states[:, 0] + 0.3 * states[:, 1]
    slack = np.maximum(np.quantile(pull, 1 - taut), pull)
    noise = 0.05 * rng.normal(size=len(pull))
    floor = floor_of(states, slack + noise, [0, 1])
    # The 0.002 quantile of all is that of 10 to 0.4 % of the slack ones.
    assert -3 * 0.05 < floor - np.quantile(pull, 1 - taut) < -0.05
    assert floor_of(states, pull + noise, [0, 1]) == -np.inf
    regular = np.stack([np.sin(np.arange(4000) / 5), np.cos(np.arange(4000) / 5)], axis=1)
    assert floor_of(regular, 2.0 * regular[:, 0] + noise, [0, 1]) == -np.inf
