"""Times to compare commits by: ``pytest benchmarks/test_speed.py --benchmark-autosave``.

``pytest-benchmark compare`` then shows a slower commit; nothing here asserts a time.
"""

import dataclasses

import numpy as np
import pytest
from problem import DT, STEPS, as_run, linear_system, names

import seakeep
from seakeep.executor import one_blas_thread
from seakeep.waves import wavenumber

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


def test_a_run_of_the_tank(benchmark):
    """A run of the paper's length; it is to take no more than 2 s of one core."""
    pytest.importorskip("numba", reason="needs the extra tank")
    from seakeep.tank.dynamics import assemble_rig, simulate
    from seakeep.tank.hydrodynamics import load_hydrodynamics
    from seakeep.tank.seas import Sea
    from seakeep.tank.settings import default_settings

    settings = default_settings()
    rig = assemble_rig(settings, load_hydrodynamics())
    omega = np.linspace(1.8, 7.1, 100)
    k = wavenumber(omega, settings.facility.water_depth)
    sea = Sea(omega, np.full(100, 0.003), np.linspace(0.0, 5.0, 100), k)
    simulate(rig, sea, 1.0)  # compiles
    benchmark(simulate, rig, sea, 210.0)


@pytest.mark.parametrize("delay_rows", ["ridge", "exact"])
def test_band_of_a_hundred_held_members(benchmark, delay_rows):
    """Mean and band on board, from arrays."""
    paper = seakeep.BayesianHankelDMDc.paper(encounter_period=32 * DT, dt=DT, n_members=100)
    ensemble = dataclasses.replace(paper, delay_rows=delay_rows).fit(RUN, STATES, INPUTS, stop=STOP)
    held, now = ensemble.hold(), PROBLEM.stop
    x, u = (np.stack([RUN[key].values for key in group], axis=1) for group in (STATES, INPUTS))
    after = u[now + 1 : now + STEPS]
    benchmark(held.forecast_arrays, x[: now + 1], u[: now + 1], after, STEPS)
