"""Times to compare commits by: ``pytest benchmarks/test_speed.py --benchmark-autosave``.

``pytest-benchmark compare`` then shows a slower commit; nothing here asserts a time.
"""

import dataclasses

import numpy as np
import pytest
from problem import DT, STEPS, as_run, linear_system, names

import seakeep
from seakeep.models.workers import one_blas_thread

PROBLEM = linear_system()
RUN, (STATES, INPUTS), STOP = as_run(PROBLEM), names(), PROBLEM.stop * DT


@pytest.mark.parametrize("delay_rows", ["ridge", "exact"])
@pytest.mark.parametrize("history", ["before", "inside"])
def test_fit_and_forecast(benchmark, delay_rows, history):
    """One model of the paper's size."""
    paper = seakeep.HankelDMDc.paper(encounter_period=32 * DT, dt=DT)
    spec = dataclasses.replace(paper, delay_rows=delay_rows, history=history)

    def call():
        return spec.fit(RUN, STATES, INPUTS, stop=STOP).forecast(RUN, start=STOP, steps=STEPS)

    with one_blas_thread():
        benchmark(call)


@pytest.mark.parametrize("delay_rows", ["ridge", "exact"])
def test_ensemble_of_ten(benchmark, delay_rows):
    """Ten members, one forecast each."""
    paper = seakeep.BayesianHankelDMDc.paper(encounter_period=32 * DT, dt=DT, n_members=10)
    ensemble = dataclasses.replace(paper, delay_rows=delay_rows).fit(RUN, STATES, INPUTS, stop=STOP)
    benchmark(ensemble.forecast_summary, RUN, start=STOP, steps=STEPS)


@pytest.mark.parametrize("delay_rows", ["ridge", "exact"])
def test_band_of_a_hundred_held_members(benchmark, delay_rows):
    """Mean and band on board, from arrays."""
    paper = seakeep.BayesianHankelDMDc.paper(encounter_period=32 * DT, dt=DT, n_members=100)
    ensemble = dataclasses.replace(paper, delay_rows=delay_rows).fit(RUN, STATES, INPUTS, stop=STOP)
    held, now = ensemble.hold(), PROBLEM.stop
    x, u = (np.stack([RUN[key].values for key in group], axis=1) for group in (STATES, INPUTS))
    after = u[now + 1 : now + STEPS]
    benchmark(held.forecast_arrays, x[: now + 1], u[: now + 1], after, STEPS)
