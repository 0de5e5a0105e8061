"""What a user would pick instead, on the same problem: each fits and forecasts the same steps."""

from __future__ import annotations

import warnings

import numpy as np
from problem import INPUT_DELAYS, RIDGE, SNAPSHOTS, STATE_DELAYS, STEPS, Problem

SURVEY = {
    "plain NumPy, the paper's formula": 52.0,
    "scikit-learn Ridge and a loop": 1.04 * 52.0,
    "pykoop, Edmd with delays": 8.8 * 52.0,
    "nfoursid, order 12": 1.2 * 52.0,
    "seakeep, delay_rows='ridge'": 0.44 * 52.0,
    "seakeep, delay_rows='exact'": 0.16 * 52.0,
}
"""Milliseconds of a survey on another machine, history inside, before this package was written.

Those of seakeep are of its prototype in plain NumPy and SciPy."""
SURVEY_ENSEMBLE = {
    "plain NumPy, loops over the same cells": 4900.0,
    "seakeep, delay_rows='ridge'": 0.46 * 4900.0,
    "seakeep, delay_rows='exact'": 0.12 * 4900.0,
}
"""The same for an ensemble of 100 with one forecast each."""


def contenders(problem: Problem, history: str) -> dict:
    """Calls by name; packages that are not installed are left out."""
    out = {}
    for name, make in (
        ("scikit-learn Ridge and a loop", _ridge),
        ("pykoop, Edmd with delays", _pykoop),
        ("nfoursid, order 12", _nfoursid),
    ):
        try:
            out[name] = make(problem, history)
        except ImportError:
            print(f"{name}: not installed")
    return out


def _training(problem: Problem, history: str):
    """Standardised series of the window with its history, and what standardises a forecast."""
    first = problem.stop - SNAPSHOTS + 1
    window = slice(first, problem.stop + 1)
    x_mean, x_std = problem.states[window].mean(axis=0), problem.states[window].std(axis=0, ddof=1)
    u_mean, u_std = problem.inputs[window].mean(axis=0), problem.inputs[window].std(axis=0, ddof=1)
    reach = 0 if history == "inside" else max(STATE_DELAYS, INPUT_DELAYS)
    used = slice(first - reach, problem.stop + 1)
    x, u = (problem.states - x_mean) / x_std, (problem.inputs - u_mean) / u_std
    return x, u, used, x_mean, x_std


def _embed(series: np.ndarray, delays: int) -> np.ndarray:
    count = len(series) - delays
    return np.concatenate([series[delays - d : delays - d + count] for d in range(delays + 1)], 1)


def _ridge(problem: Problem, history: str):
    from sklearn.linear_model import Ridge

    def call():
        x, u, used, mean, std = _training(problem, history)
        reach = max(STATE_DELAYS, INPUT_DELAYS)
        states = _embed(x[used], STATE_DELAYS)[reach - STATE_DELAYS : -1]
        inputs = _embed(u[used], INPUT_DELAYS)[reach - INPUT_DELAYS : -1]
        model = Ridge(alpha=RIDGE, fit_intercept=False)
        model.fit(np.concatenate([states, inputs], axis=1), x[used][reach + 1 :])
        start = problem.stop
        state = x[start - STATE_DELAYS : start + 1][::-1].ravel()
        forcing = _embed(u[start - INPUT_DELAYS : start + STEPS], INPUT_DELAYS)
        out = np.empty((STEPS, x.shape[1]))
        for k in range(STEPS):
            out[k] = model.coef_ @ np.concatenate([state, forcing[k]])
            state = np.concatenate([out[k], state[: -x.shape[1]]])
        return out * std + mean

    return call


def _pykoop(problem: Problem, history: str):
    import pykoop

    def call():
        x, u, used, mean, std = _training(problem, history)
        model = pykoop.KoopmanPipeline(
            lifting_functions=[
                (
                    "delays",
                    pykoop.DelayLiftingFn(n_delays_state=STATE_DELAYS, n_delays_input=INPUT_DELAYS),
                )
            ],
            regressor=pykoop.Edmd(alpha=RIDGE),
        )
        training = np.concatenate([x[used], u[used]], axis=1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model.fit(training, n_inputs=u.shape[1], episode_feature=False)
            start = problem.stop
            first = start - model.min_samples_ + 1
            result = model.predict_trajectory(
                x[first : start + 1],
                u[first : start + STEPS + 1],
                relift_state=False,
                episode_feature=False,
            )
        return result[-STEPS:, : x.shape[1]] * std + mean

    return call


def _nfoursid(problem: Problem, history: str):
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    order, blocks = 12, 12

    def call():
        x, u, used, mean, std = _training(problem, history)
        states, inputs = [f"x{i}" for i in range(x.shape[1])], [f"u{i}" for i in range(u.shape[1])]
        frame = pd.DataFrame(np.concatenate([x[used], u[used]], 1), columns=[*states, *inputs])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            identification = NFourSID(
                frame, output_columns=states, input_columns=inputs, num_block_rows=blocks
            )
            identification.subspace_identification()
            found, _ = identification.system_identification(rank=order)
        a, b, c, d = found.a, found.b, found.c, found.d
        # The state at the start by least squares over the history, as a user would; the package's
        # Kalman filter gives the same accuracy.
        start, length = problem.stop, 4 * blocks
        past_x, past_u = x[start - length + 1 : start + 1], u[start - length + 1 : start + 1]
        observability, forced, state = [], [], np.zeros(order)
        power = np.eye(order)
        for k in range(length):
            observability.append(c @ power)
            forced.append(c @ state + d @ past_u[k])
            state, power = a @ state + b @ past_u[k], a @ power
        residual = (past_x - np.array(forced)).ravel()
        initial = np.linalg.lstsq(np.concatenate(observability), residual, rcond=None)[0]
        state = state + power @ initial
        out = np.empty((STEPS, x.shape[1]))
        for k in range(STEPS):
            now = u[start + 1 + k]
            out[k] = c @ state + d @ now
            state = a @ state + b @ now
        return out * std + mean

    return call
