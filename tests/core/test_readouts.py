"""Read-outs: a load by the wave at its line, and the floor of a line that falls slack."""

import numpy as np
import pytest
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from seakeep.core.readouts import KNOTS, LoadMap, best_place, features, floor_of, sums, weights_of


def motions_and_wave(seed=0, count=4000):
    """Surge, heave, and elevation and rate of a wave, standardised."""
    return default_rng(seed).standard_normal((count, 4))


def test_features_are_those_of_the_recipe():
    values = np.array([[1.5], [-2.0], [1.25], [-3.0]])
    found = np.ravel(features(values, np.array([-1.0, 2.0])))
    expected = [
        *(1.5, -2.0, 2.5, 0.0),  # motions and hinges
        *(1.25, -3.0, 3.0, 1.5625, -3.75, 0.75),
        *(-3.0, 3.0, -3.0, 3.0, -1.5, 1.5),  # wet above 0, 0.5 and 1 SD, over half an SD
    ]
    assert_array_equal(found, expected)


def test_weights_of_a_load_of_known_form_are_recovered_but_for_the_ridge():
    values = motions_and_wave(count=20_000)
    knots = np.quantile(values[:, 0], KNOTS)
    columns = np.stack(features([*values.T], knots), axis=1)
    known = np.zeros(columns.shape[1])
    known[[0, 4, 7, -1]] = 2.0, 1.0, -3.0, 4.0  # surge, a hinge, the wave, a ramp
    products = sums(values, 7.0 + columns @ known, knots)
    found = weights_of(products)
    # λ pulls combinations of nearly collinear features; without it they are exact.
    gram, right = products[:-1, :-1].copy(), products[:-1, -1]
    assert_near(np.linalg.solve(gram, right), [7.0, *known], 1e-8)
    gram[np.diag_indices_from(gram)] += 1e-2 * len(values) * (np.arange(len(gram)) > 0)
    assert_allclose(gram @ found, right, rtol=1e-9)


def test_the_place_is_the_one_that_other_runs_vouch_for():
    rng = default_rng(1)
    runs = [motions_and_wave(seed, 500) for seed in range(3)]
    knots = np.quantile(runs[0][:, 0], KNOTS)
    loads = [each[:, 2] + each[:, 0] + 0.1 * rng.standard_normal(500) for each in runs]
    # One run errs least at a place where the others' waves mean nothing.
    noisy = [np.where([1, 1, 0, 0], each, rng.standard_normal(each.shape)) for each in runs]
    fits_one = [noisy[0], noisy[1], np.column_stack([runs[2][:, :2], 9 * loads[2], loads[2]])]
    products = np.stack(
        [
            [sums(values, load, knots) for values, load in zip(each, loads, strict=True)]
            for each in (fits_one, noisy, runs)
        ]
    )
    assert best_place(products) == best_place(products[:, :1]) == 2


def test_a_load_gives_way_to_its_state_outside_training():
    ends = np.ones(3)
    load = LoadMap(
        -1.0, 1, [0], np.zeros(3), np.array([1.0, 1.0, 2.0]), -2 * ends, 2 * ends,
        np.zeros(5), np.concatenate([[3.0], np.zeros(18)]), np.array([-1.0, 2.5]),
    )  # fmt: skip
    states = np.array([[0.0, 9.0], [0.0, 9.0], [-2.5, 9.0], [0.0, 9.0], [-3.0, 9.0]])
    wave = np.array([[0.0, 0.0], [2.0, 2.0], [0.0, 0.0], [0.0, 3.0], [2.5, 0.0]])
    # The regression says 3 and is clipped to 2.5; half of the weight is left half an SD outside.
    parts = np.array([1.0, 1.0, 1 / 2, 1 / 2, 1 / 6])
    assert_allclose(load(states, wave), 9.0 + parts * (2.5 - 9.0), rtol=1e-15)


@pytest.mark.parametrize("taut", [0.5, 0.8, 0.98])
def test_a_floor_is_found_where_a_line_rests_on_it(taut):
    rng = default_rng(3)
    states = rng.normal(size=(4000, 2))
    pull = 2.0 * states[:, 0] + 0.3 * states[:, 1]
    slack = np.maximum(np.quantile(pull, 1 - taut), pull)
    noise = 0.05 * rng.normal(size=len(pull))
    runs = np.zeros(len(pull), int)
    floor = floor_of(states, slack + noise, [0, 1], runs)
    # The 0.002 quantile of all is that of 10 to 0.4 % of the slack ones.
    assert -3 * 0.05 < floor - np.quantile(pull, 1 - taut) < -0.05
    assert floor_of(states, pull + noise, [0, 1], runs) == -np.inf
    regular = np.stack([np.sin(np.arange(4000) / 5), np.cos(np.arange(4000) / 5)], axis=1)
    assert floor_of(regular, 2.0 * regular[:, 0] + noise, [0, 1], runs) == -np.inf


def test_zeros_of_a_sensor_that_differ_from_run_to_run_are_no_floor():
    runs, rng = np.repeat(range(4), 2000), default_rng(1)
    states = rng.normal(np.array([0.0, 0.0, -2.5, -2.0])[runs, None], 1.0, (8000, 1))
    load = 0.6 * np.exp(0.5 * states[:, 0]) + rng.normal(0.0, 0.02, 8000)
    measured = load + np.array([-0.3, -1.4, 0.2, 1.2])[runs]
    assert np.isfinite(floor_of(states, measured, [0], 0 * runs))
    assert floor_of(states, measured, [0], runs) == -np.inf
