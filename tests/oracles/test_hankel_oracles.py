"""The model against outside packages: pykoop, scipy, plain numpy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from records import record, table
from scipy import signal

from seakeep import HankelDMDc

pytestmark = pytest.mark.oracle

STATES, INPUTS = ["heave", "pitch"], ["eta_fwd", "eta_cog"]
N, Q = 2, 2
DELAYS = [(4, 7), (6, 3), (3, 3), (0, 0)]
# Gram matrices of these runs at λ = 0.5 have condition numbers near 1e4: rounding leaves 1e-12.
SAME_MATRICES = 1e-10
# Hundreds of steps of a free run add their rounding up.
SAME_FORECAST = 1e-9


def fit(runs, s, z, ridge=0.5, **settings):
    settings = {"standardize": False, "history": "inside", **settings}
    return HankelDMDc(s, z, ridge, **settings).fit(runs, states=STATES, inputs=INPUTS)


def koopman_pipeline(runs, s, z):
    pykoop = pytest.importorskip("pykoop")
    pipeline = pykoop.KoopmanPipeline(
        lifting_functions=[("delay", pykoop.DelayLiftingFn(n_delays_state=s, n_delays_input=z))],
        regressor=pykoop.Edmd(alpha=0.5),
    )
    data = pykoop.combine_episodes(
        [(number, table(run, STATES + INPUTS)) for number, run in enumerate(runs)],
        episode_feature=True,
    )
    pipeline.fit(data, n_inputs=Q, episode_feature=True)
    return pipeline


def assert_equals_pykoop(model, runs, s, z):
    coefficients = koopman_pipeline(runs, s, z).regressor_.coef_.T
    found = np.hstack([model.A, model.B])
    assert_allclose(found, coefficients, rtol=0, atol=SAME_MATRICES)


@pytest.mark.parametrize(("s", "z"), DELAYS)
@pytest.mark.parametrize("count", [1, 2])
def test_matrices_equal_pykoop(make_run, s, z, count):
    runs = [make_run(samples=200 + 30 * seed, seed=seed) for seed in range(count)]
    assert_equals_pykoop(fit(runs, s, z), runs, s, z)


def test_a_window_with_history_inside_equals_pykoop_on_these_samples_alone(make_run):
    run = make_run(samples=300)
    samples = run.isel(time=slice(180, 300))
    assert_equals_pykoop(fit(run, 4, 7, window=120), [samples], 4, 7)


@pytest.mark.parametrize(("delay_rows", "relift"), [("ridge", False), ("exact", True)])
@pytest.mark.parametrize(("s", "z"), [(4, 7), (6, 3)])
def test_forecasts_equal_pykoop(make_run, delay_rows, relift, s, z):
    runs = [make_run(samples=200), make_run(samples=180, seed=1)]
    other = make_run(samples=160, seed=2)
    model = fit(runs, s, z, delay_rows=delay_rows)
    pipeline = koopman_pipeline(runs, s, z)
    first = model.history_samples
    expected = pipeline.predict_trajectory(
        table(other, STATES)[:first],
        table(other, INPUTS),
        relift_state=relift,
        episode_feature=False,
    )
    forecast = model.forecast(other, start=float(other.time[first - 1]), steps=160 - first)
    assert_allclose(table(forecast, STATES), expected[first:], rtol=0, atol=SAME_FORECAST)


@pytest.mark.parametrize(("s", "z"), [(4, 7), (6, 3), (5, 0), (3, 1)])
@pytest.mark.parametrize("delay_rows", ["ridge", "exact"])
def test_scipy_simulates_the_exported_system_like_our_forecast(make_run, s, z, delay_rows):
    run = make_run(samples=300)
    # Ridge enough for a stable model: an unstable one would compare rounding of large numbers.
    model = fit(run, s, z, ridge=2.0, delay_rows=delay_rows, standardize=True)
    assert model.spectral_radius < 1
    start, steps = 100, 150
    instant = float(run.time[start])
    deviations = table(run, INPUTS)[start : start + steps + 1] - model.input_mean
    system = model.to_state_space()
    assert isinstance(system, signal.StateSpace)
    assert system.dt == model.dt
    assert not np.any(system.D)
    assert system.A.shape == (N * (s + 1) + Q * z,) * 2
    _, output, _ = signal.dlsim(system, deviations, x0=model.initial_state(run, start=instant))
    physical, forecast = output + model.state_mean, model.forecast(run, start=instant, steps=steps)
    # The first output is the measured state at the start; values are of order one.
    assert_allclose(physical[0], table(run, STATES)[start], rtol=0, atol=1e-12)
    assert_allclose(physical[1:], table(forecast, STATES), rtol=0, atol=1e-10)


def test_the_papers_formula_in_plain_numpy_at_the_papers_size():
    rng = np.random.default_rng(0)
    n, q, m, s, z, ridge = 11, 2, 640, 32, 160, 100.0
    x = np.cumsum(rng.standard_normal((z + m, n)), axis=0)
    x = (x - x[z:].mean(axis=0)) / x[z:].std(axis=0, ddof=1)
    u = rng.standard_normal((z + m, q))
    u = (u - u[z:].mean(axis=0)) / u[z:].std(axis=0, ddof=1)

    # x_j … x_{m−1} and their successors, the Hankel matrices of lags below (equations of HDMDc).
    columns = np.arange(z, z + m - 1)
    extended_x = np.vstack([x[columns - lag].T for lag in range(s + 1)])
    extended_u = np.vstack([u[columns - lag].T for lag in range(z + 1)])
    successors = np.vstack([x[columns + 1 - lag].T for lag in range(s + 1)])
    y = np.vstack([extended_x, extended_u])
    assert y.shape == (685, 639)
    g = successors @ y.T @ np.linalg.inv(y @ y.T + ridge * np.eye(len(y)))

    states, inputs = [f"x{i}" for i in range(n)], [f"u{i}" for i in range(q)]
    columns = zip(states + inputs, np.hstack([x, u]).T, strict=True)
    run = record(0.05125, **dict(columns))
    spec = HankelDMDc.paper(encounter_period=1.64, dt=1.64 / 32)
    model = spec.fit(run, states, inputs)
    assert model.training.columns == (639,)
    # Fewer columns than rows; with all rows regressed the primal form is still less work.
    assert model.training.method == "primal"
    # The primal inverse at this size, condition number near 1e4, is good to about 1e-12.
    assert_allclose(np.hstack([model.A, model.B]), g, rtol=0, atol=1e-10)
