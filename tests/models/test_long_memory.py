"""Averages of the states over doubling blocks of delays, beyond those that stand alone."""

from dataclasses import replace

import numpy as np
import pytest
from near import assert_near
from oscillators import OF_ARX, arx_run
from said import request_error

from seakeep import HankelDMDc, Select, tune

WEIGHTS = np.array([0.9, -0.5, 0.0, 0.0, 0.0, *[0.3 / 4] * 4, *[-0.4 / 8] * 8])
"""Of x(k) … x(k − 16): two delays, and the means of delays 5 to 8 and 9 to 16."""
SPEC = HankelDMDc(4, 0, 0.0, standardize=False, delay_rows="exact", memory=16)


def remembering(seed, samples=300):
    """A heave that remembers means of its past, driven by the wave of the instant."""
    return arx_run(seed, WEIGHTS, [0.7], samples, 0.4)


def test_a_sparse_memory_is_recovered():
    model = SPEC.fit([remembering(1), remembering(2)], *OF_ARX)
    # Exact data: what is left is rounding times the condition number, below 1e3.
    assert_near([*model.A[0], *model.B[0]], [*WEIGHTS, 0.7], 1e-10)
    run = remembering(7)
    assert_near(model.forecast(run, start=5.0, steps=200).heave, run.heave[51:251], 1e-9)


@pytest.mark.parametrize("more", [{"delay_rows": "ridge"}, {"stable": True}])
def test_regressed_delay_rows_and_clipped_modes_have_no_memory(more):
    settings = {"delay_rows": "exact", "memory": "8 T", **more}
    with request_error("memory averages delayed states, which takes delay"):
        HankelDMDc(4, 4, 1.0, **settings)


def test_a_memory_is_recommended_where_the_vessel_has_one():
    given = {f"run{seed}": remembering(seed, samples=500) for seed in range(3)}
    given = {name: run.assign_attrs(encounter_period=0.2) for name, run in given.items()}
    spec = HankelDMDc(
        2, 0, "rollout", delay_rows="exact", select=Select(memory=True, period=0.2, horizon=(20,))
    )
    assert spec.needs(0.1).history == 16
    model = spec.fit(given, *OF_ARX)
    assert (model.settings.memory, model.settings.state_delays) == (16, 2)
    assert "memory 16  (chosen)" in model.selection
    tuned = tune(replace(spec, select=None), given, *OF_ARX, vary=["memory"], horizon=[20.0])
    # Of the same windows, and without a period of its own.
    assert tuned.settings.memory == round(8 * 0.2 / 0.1)
