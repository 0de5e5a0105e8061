"""Residuals of models that are right and wrong, and the oracles of their tests."""

import tracemalloc

import numpy as np
import pytest
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose
from records import autoregressive, record
from scipy import signal

from seakeep import HankelDMDc, check
from seakeep.core.spectra import autocorrelation, input_correlation, ljung_box


@pytest.fixture(scope="module")
def run():
    """Heave answers the wave one and two samples before, with white process noise."""
    rng = default_rng(0)
    wave = autoregressive(rng.standard_normal(3000), 0.8)
    driven = 0.5 * np.roll(wave, 1) + 0.3 * np.roll(wave, 2) + 0.2 * rng.standard_normal(3000)
    attrs = {"encounter_period": 2.0, "test_span": (150.0, 299.9)}
    return record(0.1, attrs, eta=wave, heave=autoregressive(driven, 0.6))


def fitted(run, input_delays):
    spec = HankelDMDc(0, input_delays, 1e-6, delay_rows="exact")
    return spec.fit(run.isel(time=slice(1500)), ["heave"], ["eta"])


def test_a_right_model_leaves_white_errors(run):
    right, poor = (check.residuals(fitted(run, delays), {"run": run}) for delays in (1, 0))
    assert right.probability[0] > 0.01 > 10 * poor.probability[0]
    beyond, worst = (np.abs(each.input_correlation) / each.input_limit for each in (right, poor))
    assert (beyond > 1).mean() < 0.15
    assert worst.max() > 3
    assert right.attrs["instants"] == 1499


def test_bands_and_ages_add_up(run):
    found = check.residuals(fitted(run, 1), {"run": run})
    whole = found.error_spectrum.sum("frequency") / found.measured_spectrum.sum("frequency")
    assert_allclose((found.band_nrmse**2).sum("band").values, whole.values)
    assert_allclose(found.age_nrmse[0, 0], found.one_step[0], rtol=0.3)
    assert found.age_nrmse[0, -1] < 1


def test_runs_count_alike_in_the_ages(run):
    model, spans = fitted(run, 1), {"first": (150.0, 219.9), "second": (230.0, 299.9)}
    parts = {name: run.assign_attrs(run=name, test_span=span) for name, span in spans.items()}
    alone = [check.residuals(model, {name: part}) for name, part in parts.items()]
    variances = [float(run.heave.sel(time=slice(a, b)).var()) for a, b in spans.values()]
    squares = [of.age_nrmse**2 * each for of, each in zip(alone, variances, strict=True)]
    both = check.residuals(model, parts).age_nrmse ** 2 * np.mean(variances)
    # A start more or less in either, and the first instant, which is not forecast.
    assert_allclose(both, np.mean(squares, axis=0), rtol=0.02)
    assert not np.allclose(squares[0], squares[1], rtol=0.1)


def test_memory_does_not_grow_with_what_the_starts_read():
    """A history of 400 samples (3 kB) for each of 6000 starts, and copies of it, are 80 MB."""
    rng = default_rng(0)
    wave = autoregressive(rng.standard_normal(7000), 0.8)
    attrs = {"encounter_period": 2.0, "test_span": (80.0, 699.9)}
    run = record(0.1, attrs, eta=wave, heave=np.roll(wave, 1) + rng.standard_normal(7000))
    model = HankelDMDc(399, 0, 1.0, delay_rows="exact").fit(
        run.isel(time=slice(2000)), ["heave"], ["eta"]
    )
    tracemalloc.start()
    check.residuals(model, {"run": run})
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 45e6


@pytest.mark.oracle
def test_ljung_box_is_that_of_statsmodels():
    diagnostic = pytest.importorskip("statsmodels.stats.diagnostic")
    x = signal.lfilter([1, 0.2], [1], default_rng(1).standard_normal(400))
    ours = ljung_box(autocorrelation([x[:, None]], 12), 400)
    known = diagnostic.acorr_ljungbox(x, lags=[12])
    assert_allclose(ours[0][0], known["lb_stat"].item(), rtol=1e-9)  # rounding of an FFT
    assert_allclose(ours[1][0], known["lb_pvalue"].item(), rtol=1e-8)


def test_records_shorter_than_the_lags_add_what_they_have():
    long = np.array([1.0, -1.0, 2.0, -2.0])[:, None]
    short = np.array([3.0, -3.0])[:, None]
    # Products at lags 0 to 3: 10, -7, 4, -2 of the long record and 18, -9 of the short one.
    expected = np.array([28.0, -16.0, 4.0, -2.0]) / 28
    for pieces in ([long, short], [short, long]):
        assert_allclose(autocorrelation(pieces, 9)[:, 0], expected, atol=1e-15)
        found, _ = input_correlation([(each, each) for each in pieces], 9)
        assert_allclose(found[:, 0, 0], expected, atol=1e-15)  # rounding of an FFT


def test_limits_of_the_correlation_with_inputs_cover_as_they_say():
    rng = default_rng(2)
    wave = autoregressive(rng.standard_normal((2000, 1)), 0.9, axis=0)
    errors = autoregressive(rng.standard_normal((2000, 500)), 0.5, axis=0)
    found, limit = input_correlation([(errors, wave)], 40)
    # 500 repetitions know a coverage of 95 % to 1 % (one SD) at each of 41 lags.
    assert_near((np.abs(found[:, :, 0]) < limit[:, 0]).mean(), 0.95, 0.01)


def test_limits_and_past_inputs_are_those_of_the_errors_by_hand(run):
    model = fitted(run, 0)
    found = check.residuals(model, {"run": run})
    assert_allclose(found.limit, 1.96 / np.sqrt(1499), rtol=1e-12)
    first, last = 1500, 2999  # the last measured state before each step of the test part
    made = model.judged_runs(run, "run", range(first, last), 1)[0][:, 0, 0]
    error = made - run.heave.values[first + 1 : last + 1]
    inputs = run.eta.values[first + 1 : last + 1]
    e, u = error - error.mean(), inputs - inputs.mean()
    for lag in (0, 1, 2):
        expected = e[lag:] @ u[: len(u) - lag] / np.sqrt((e @ e) * (u @ u))
        assert_near(found.input_correlation[0, 0, lag], expected, 1e-10)
