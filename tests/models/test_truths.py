"""Vessels whose law is known: a drift by the square of the wave, and the best λ."""

from dataclasses import replace

import numpy as np
import pytest
from records import record
from scipy import signal
from seas import sea

from seakeep import HankelDMDc, SlowSquares, tune
from seakeep.core.observables import slow_kernel, slow_squares
from seakeep.models.selection import select

DT, PERIOD = 0.1, 10  # s, samples
KERNEL = slow_kernel(1 / (3 * PERIOD), 15)
NOISE = 0.02
ATTRS = {"encounter_period": PERIOD * DT}


def drifting(seed, samples=1500):
    """A surge that answers the slow square of waves up to two periods ahead, read with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) * DT
    eta = 0.5 * sea(seed, (0.7, 1.3), 1.0, 12).at(t)
    square = slow_squares(eta, 0, KERNEL, (2 * PERIOD - 15,), DT)[:, 0]
    known = np.isfinite(square)
    surge = signal.lfilter([0.0, 1.0], [1.0, -0.95], np.where(known, 0.05 * square, 0.01))
    noise = NOISE * surge.std() * rng.standard_normal(samples)
    return record(DT, ATTRS, eta=eta, surge=surge + noise), surge


def test_a_quadratic_drift_is_recovered_to_its_noise():
    runs = [drifting(seed)[0] for seed in range(4)]
    spec = HankelDMDc(10, 0, 1e-6, delay_rows="exact", ridge_scale="per_snapshot")
    observed = replace(spec, observables=(SlowSquares("eta", (0,), 1 / 3, 2.0, lags=(0,)),))
    run, true = drifting(9)
    errors = []
    for each in (spec, observed):
        model = each.fit(runs, ["surge"], ["eta"])
        forecast = model.forecast(run, start=10.0, steps=1000)
        at = slice(101, 1101)
        errors.append(np.sqrt(np.mean((forecast.surge.values - true[at]) ** 2)) / true[at].std())
    # Over 1000 steps nothing but the waves is read; what is left is the noise of the readings.
    assert errors[0] > 0.5
    assert errors[1] < 2 * NOISE


def test_a_search_reads_nothing_after_the_stop():
    runs = {str(seed): drifting(seed, 800)[0] for seed in range(2)}
    poisoned = {name: run.copy(deep=True) for name, run in runs.items()}
    for run in poisoned.values():
        for channel in ("eta", "surge"):
            run[channel].values[701:] = np.nan
    spec = HankelDMDc(5, 5, "rollout", delay_rows="exact")
    options = {"vary": ("observables", "lead"), "horizon": (15.0,), "stop": 70.0}
    one, other = (tune(spec, each, ["surge"], ["eta"], **options) for each in (runs, poisoned))
    assert one.table.identical(other.table)
    assert np.isfinite(one.table["score"]).all()


def test_the_best_ridge_is_that_of_the_noise():
    """Coefficients drawn at random: the best λ is the noise's variance over theirs."""
    rng = np.random.default_rng(0)
    channels, delays, best = 8, 40, 1e-2
    pairs = 5 * (90 - delays - 1)  # of the five runs that train in each fold
    # Regressors have a variance of one, so that λ = σ² / τ² = best × pairs.
    tau = 1.0 / np.sqrt(best * pairs)
    weights = tau * rng.standard_normal((channels, delays + 1))
    runs = {}
    for number in range(6):
        eta = rng.standard_normal(90)
        states = rng.standard_normal((channels, 90))  # the noise
        for k in range(delays, 89):
            states[:, k + 1] += weights @ eta[k - delays : k + 1][::-1]
        named = {f"x{row}": values for row, values in enumerate(states)}
        runs[f"run{number}"] = record(DT, ATTRS, eta=eta, **named)
    spec = HankelDMDc(0, delays, "rollout", delay_rows="exact")
    found = select(spec, runs, [f"x{row}" for row in range(channels)], ["eta"], horizon=(4.0,))
    scores = {row["ridge"]: row["score"] for row in found.rows}
    # Half a decade is the step of the search.
    assert np.log10(min(scores, key=scores.get)) == pytest.approx(np.log10(best), abs=0.51)
