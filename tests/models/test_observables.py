"""Observables and lead: from a measured run to the columns that drive a model."""

import numpy as np
import pytest
import xarray as xr
from records import record, table

from seakeep.core.observables import slow_kernel, slow_squares
from seakeep.models import HankelDMDc
from seakeep.models.inputs import InputMap, Regressors
from seakeep.models.labelled import Span, channel_labels
from seakeep.models.observables import Powers, SlowSquares

DT, PERIOD = 0.1, 16  # s, samples
PROBES = {"eta_fwd": 0.0, "eta_cog": 2.0}


def irregular(seed: int = 0, samples: int = 900) -> xr.Dataset:
    """Two probes 2 m apart in deep water, and a surge that wanders."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) * DT
    omega = 2 * np.pi * rng.uniform(0.45, 0.8, 12)
    phase = rng.uniform(0, 2 * np.pi, 12)
    waves = {
        name: 0.01 * np.cos(np.outer(t, omega) - omega**2 / 9.81 * x + phase).sum(axis=1)
        for name, x in PROBES.items()
    }
    attrs = {"water_depth": np.inf, "encounter_period": PERIOD * DT}
    run = record(DT, attrs, surge=0.3 + 0.2 * np.sin(2 * np.pi * t / 40), **waves)
    for name, x in PROBES.items():
        run[name].attrs["x_position"] = x
    return run


INPUTS = [*PROBES]
CHOSEN = (SlowSquares("eta_cog"), Powers(("eta_fwd", "eta_cog"), (2, 3)))


def fitted(run, lead=12, chosen=CHOSEN) -> InputMap:
    spec = HankelDMDc(8, 3 * PERIOD, 1.0, lead=lead, observables=chosen)
    return spec.input_map({"run": run}, ["surge"], INPUTS, None)


def rows(chain, run, first, stop) -> Regressors:
    span = Span(first, first, stop)
    values = table(run, INPUTS)
    read = chain.reads(span)
    drive = chain.drive(values[read.first : read.stop], [span], run=run, first=read.first)
    return drive.rows(first, stop)


def test_the_low_pass_filter_keeps_a_constant_and_damps_the_waves():
    kernel = slow_kernel(1 / (3 * PERIOD), 24)
    lag = np.arange(-24, 25)
    gains = [float(kernel @ np.cos(2 * np.pi * f * lag)) for f in (0, 1 / PERIOD, 2 / PERIOD)]
    assert gains[0] == pytest.approx(1, abs=1e-12)  # rounding of a sum of 49 numbers
    assert abs(gains[1]) < 0.03  # the side lobes of the window
    assert abs(gains[2]) < 0.01


def test_slow_squares_are_the_sums_that_they_stand_for():
    rng = np.random.default_rng(1)
    series, kernel = rng.normal(size=80), slow_kernel(0.05, 6)
    found = [slow_squares(series, order, kernel, (3, -2), DT) for order in (0, 1, 2)]
    derivatives = [
        lambda j: series[j],
        lambda j: (series[j + 1] - series[j - 1]) / (2 * DT),
        lambda j: (series[j + 1] - 2 * series[j] + series[j - 1]) / DT**2,
    ]
    for row in (20, 41, 60):
        for order, derivative in enumerate(derivatives):
            for column, shift in enumerate((3, -2)):
                middle = row + shift
                expected = sum(w * derivative(middle - 6 + i) ** 2 for i, w in enumerate(kernel))
                # Rounding of thirteen squares of second differences.
                assert found[order][row, column] == pytest.approx(expected, rel=1e-12)


def test_columns_are_named_with_units_and_stand_in_two_groups():
    run = irregular()
    chain = fitted(run)
    delayed, direct = chain.regressors(channel_labels(run, INPUTS))
    assert {label.name: label.units for label in delayed} == {
        "eta_fwd": "m",
        "eta_cog": "m",
        "eta_fwd_power_2": "m^2",
        "eta_cog_power_2": "m^2",
        "eta_fwd_power_3": "m^3",
        "eta_cog_power_3": "m^3",
    }
    assert len(direct) == 18
    assert direct[6].units == "(m/s)^2"
    # The squares look two periods ahead, which is more than the lead of the waves.
    assert chain.lead_samples == 2 * PERIOD
    # Five periods of lags and twice the filter's half width less the look-ahead.
    assert chain.history(3 * PERIOD) == 5 * PERIOD + 2 * (24 + 1) - 2 * PERIOD


def test_the_lead_shifts_the_inputs_and_not_the_squares():
    run = irregular()
    ahead = rows(fitted(run), run, 200, 300)
    plain = rows(fitted(run, lead=0), run, 200, 300)
    np.testing.assert_array_equal(ahead.delayed[:, 0], run["eta_fwd"].values[212:312])
    # The same sums, started at another sample of the convolution.
    np.testing.assert_allclose(ahead.direct, plain.direct, rtol=1e-10)
    assert np.isfinite(ahead.direct).all()


def test_powers_grow_like_the_input_far_out():
    run = irregular()
    chain = fitted(run, chosen=(Powers("eta_cog", (2, 3)),))
    sigma = float(run["eta_cog"].std())
    u = sigma * np.array([0.01, 2.0, 60.0])
    found = chain.observed.with_delayed(np.stack([0 * u, u], axis=1))[:, 2:]
    expected = np.stack([u**q / (1 + u**2 / (36 * sigma**2)) ** ((q - 1) / 2) for q in (2, 3)], 1)
    np.testing.assert_allclose(found, expected, rtol=1e-12)  # rounding
    np.testing.assert_allclose(found[2] / u[2], [6 * sigma, 36 * sigma**2], rtol=0.01)  # 36/60²


def test_slow_squares_above_those_of_training_grow_by_seven_tenths():
    run = irregular()
    chain = fitted(run, chosen=(SlowSquares("eta_cog", orders=(0,), lags=(0,)),))
    waves = table(run, INPUTS)
    inside = chain.observed.direct(waves)[:, 0]
    top = np.nanmax(inside)
    twice = chain.observed.direct(np.sqrt(2.0) * waves)[:, 0]
    expected = np.where(2 * inside > top, top + 0.7 * (2 * inside - top), 2 * inside)
    np.testing.assert_allclose(twice, expected, rtol=1e-12)
    assert (2 * inside > top).any()
