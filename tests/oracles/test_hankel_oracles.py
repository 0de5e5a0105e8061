"""The model against outside packages: pykoop, scipy, plain numpy."""

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_array_equal
from records import record, table
from scipy import signal

from seakeep import HankelDMDc

pytestmark = pytest.mark.oracle

STATES, INPUTS = ["heave", "pitch"], ["eta_fwd", "eta_cog"]
# Gram matrices of these runs at λ = 0.5 have condition numbers near 1e4: rounding leaves 1e-12.
SAME_MATRICES = 1e-10
# Hundreds of steps of a free run add their rounding up.
SAME_FORECAST = 1e-9


def fit(runs, s, z, ridge=0.5, **settings):
    settings = {"standardize": False, "history": "inside", **settings}
    return HankelDMDc(s, z, ridge, **settings).fit(runs, states=STATES, inputs=INPUTS)


@pytest.mark.parametrize(("delay_rows", "relift"), [("ridge", False), ("exact", True)])
@pytest.mark.parametrize(("s", "z"), [(4, 7), (6, 3)])
def test_matrices_and_forecasts_equal_pykoop(make_run, delay_rows, relift, s, z):
    """Of the newest 150 samples of two runs, history inside."""
    pykoop = pytest.importorskip("pykoop")
    runs, other = [make_run(samples=200), make_run(samples=180, seed=1)], make_run(160, seed=2)
    model = fit(runs, s, z, delay_rows=delay_rows, window=150)
    pipeline = pykoop.KoopmanPipeline(
        lifting_functions=[("delay", pykoop.DelayLiftingFn(n_delays_state=s, n_delays_input=z))],
        regressor=pykoop.Edmd(alpha=0.5),
    )
    data = pykoop.combine_episodes(
        [(number, table(run, STATES + INPUTS)[-150:]) for number, run in enumerate(runs)],
        episode_feature=True,
    )
    pipeline.fit(data, n_inputs=len(INPUTS), episode_feature=True)
    if not relift:
        found = np.hstack([model.A, model.B])
        assert_near(found, pipeline.regressor_.coef_.T, SAME_MATRICES)
    first = model.history_samples
    expected = pipeline.predict_trajectory(
        table(other, STATES)[:first],
        table(other, INPUTS),
        relift_state=relift,
        episode_feature=False,
    )
    forecast = model.forecast(other, start=float(other.time[first - 1]), steps=160 - first)
    assert_near(table(forecast, STATES), expected[first:], SAME_FORECAST)


@pytest.mark.parametrize(("s", "z"), [(4, 7), (6, 3), (5, 0), (3, 1)])
@pytest.mark.parametrize("delay_rows", ["ridge", "exact"])
def test_scipy_simulates_the_exported_system_like_our_forecast(make_run, s, z, delay_rows):
    run = make_run(samples=300)
    # Ridge enough for a stable model: an unstable one would compare rounding of large numbers.
    model = fit(run, s, z, ridge=2.0, delay_rows=delay_rows, standardize=True)
    start, steps = 100, 150
    x, u = table(run, STATES), table(run, INPUTS)
    state = model.initial_state_arrays(x[: start + 1], u[: start + 1])
    assert_array_equal(model.initial_state(run, float(run.time[start])), state)
    system = model.to_state_space()
    assert system.dt == model.dt
    assert len(system.A) == 2 * (s + 1) + 2 * z
    deviations = u[start : start + steps + 1] - model.input_mean
    physical = signal.dlsim(system, deviations, x0=state)[1] + model.state_mean
    forecast = model.forecast(run, start=float(run.time[start]), steps=steps)
    # The first output is the measured state at the start; values are of order one.
    assert_near(physical[0], x[start], 1e-12)
    assert_near(physical[1:], table(forecast, STATES), 1e-10)


def test_a_system_of_python_control_has_the_step_and_the_names(run):
    """What it forecasts: the tutorial, in `tests/docs/test_pages.py`."""
    pytest.importorskip("control")
    model = fit(run, 3, 1)
    system = model.to_control()
    assert system.dt == model.dt
    assert (system.input_labels, system.output_labels) == (model.inputs, model.states)


def test_the_papers_formula_in_plain_numpy_at_the_papers_size():
    rng = np.random.default_rng(0)
    n, q, m, s, z, ridge = 11, 2, 640, 32, 160, 100.0
    x = np.cumsum(rng.standard_normal((z + m, n)), axis=0)
    u = rng.standard_normal((z + m, q))
    states, inputs = [f"x{i}" for i in range(n)], [f"u{i}" for i in range(q)]
    run = record(0.05125, **dict(zip(states + inputs, np.hstack([x, u]).T, strict=True)))

    def extended(series, delays, first):
        """Columns j = `first` … of deviations, m − 1 of them (equations of HDMDc)."""
        window = series[z:]
        deviations = (series - window.mean(axis=0)) / window.std(axis=0, ddof=1)
        lags = range(delays + 1)
        return np.vstack([deviations[first - lag : first - lag + m - 1].T for lag in lags])

    y = np.vstack([extended(x, s, z), extended(u, z, z)])
    assert y.shape == (685, 639)
    g = extended(x, s, z + 1) @ y.T @ np.linalg.inv(y @ y.T + ridge * np.eye(len(y)))
    model = HankelDMDc.paper(encounter_period=1.64, dt=1.64 / 32).fit(run, states, inputs)
    # Fewer columns than rows; with all rows regressed the primal form is still less work.
    assert model.training.method == "primal"
    # The primal inverse at this size, condition number near 1e4, is good to about 1e-12.
    assert_near(np.hstack([model.A, model.B]), g, 1e-10)
