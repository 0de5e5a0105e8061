"""Observables and lead: from a measured run to the columns that drive a model."""

from dataclasses import dataclass

import numpy as np
from drifting import DT, INPUTS
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from records import table

from seakeep import HankelDMDc, Powers, SlowSquares
from seakeep.models.labelled import ChannelLabel, Span, TrainingRuns, channel_labels
from seakeep.models.terms import Bound, slow_kernel, slow_squares

PERIOD = 15  # samples
CHOSEN = (SlowSquares("eta_cog"), Powers(("eta_fwd", "eta_cog"), (2, 3)))


def fitted(run, lead=12, chosen=CHOSEN):
    spec = HankelDMDc(8, 3 * PERIOD, 1.0, lead=lead, observables=chosen)
    return spec.input_map(TrainingRuns({"run": run}, ["surge"], INPUTS), None)


def rows(chain, run, first, stop):
    span = Span(first, first, stop)
    values = table(run, INPUTS)
    read = chain.reads(span)
    drive = chain.drive(values[read.first : read.stop], [span], run=run, first=read.first)
    return drive.rows(first, stop)


@dataclass(frozen=True)
class Turned:
    """Reads two samples before and one after, with the delays, and counts in periods."""

    period: float | None = None
    kind, delayed = "turned", True

    def reach(self, dt):
        return 2, 1

    def bind(self, inputs, dt):
        label = ChannelLabel("turned", "m", f"curved, {self.period / dt:.1f}")
        return Bound(
            (label,), lambda u: np.roll(u[:, :1], -1, axis=0) - np.roll(u[:, :1], 2, axis=0)
        )


def test_settings_need_what_a_delayed_observable_reads(drift):
    spec = HankelDMDc(8, 12, 1.0, lead=5, observables=(Turned(),))
    model = spec.fit(drift, ["surge"], INPUTS)
    needs = spec.needs(DT)
    assert (needs.history, needs.lead) == (14, 6)
    assert (model.history_samples - 1, model.lead_samples) == (14, 6)
    assert_allclose(model.signature.input_map.observed.observables[0].period, 1.5, rtol=0.2)


def test_the_low_pass_filter_keeps_a_constant_and_damps_the_waves():
    kernel = slow_kernel(1 / (3 * PERIOD), 24)
    lag = np.arange(-24, 25)
    gains = [float(kernel @ np.cos(2 * np.pi * f * lag)) for f in (0, 1 / PERIOD, 2 / PERIOD)]
    assert_near(gains[0], 1, 1e-12)  # rounding of a sum of 49 numbers
    assert abs(gains[1]) < 0.03  # the side lobes of the window
    assert abs(gains[2]) < 0.01


def test_slow_squares_are_the_sums_that_they_stand_for():
    series, kernel = np.random.default_rng(1).normal(size=80), slow_kernel(0.05, 6)
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
                assert_allclose(found[order][row, column], expected, rtol=1e-12)


def test_columns_are_named_with_units_and_stand_in_two_groups(drift):
    chain = fitted(drift)
    delayed, direct = chain.regressors(channel_labels(drift, INPUTS))
    expected = dict.fromkeys(INPUTS, "m")
    expected |= {f"{name}_power_{q}": f"m^{q}" for q in (2, 3) for name in INPUTS}
    assert {label.name: label.units for label in delayed} == expected
    assert len(direct) == 18
    assert direct[6].units == "(m/s)^2"
    # The squares look two periods ahead, which is more than the lead of the waves.
    assert chain.around.ahead == 2 * PERIOD
    # Five periods of lags and twice the filter's half width less the look-ahead.
    assert chain.history(3 * PERIOD) == 5 * PERIOD + 2 * (22 + 1) - 2 * PERIOD


def test_the_lead_shifts_the_inputs_and_not_the_squares(drift):
    ahead, plain = (rows(fitted(drift, lead=lead), drift, 200, 300) for lead in (12, 0))
    assert_array_equal(ahead.delayed[:, 0], drift["eta_fwd"].values[212:312])
    # The same sums, started at another sample of the convolution.
    assert_allclose(ahead.direct, plain.direct, rtol=1e-10)
    assert np.isfinite(ahead.direct).all()


def test_powers_grow_like_the_input_far_out(drift):
    chain = fitted(drift, chosen=(Powers("eta_cog", (2, 3)),))
    sigma = float(drift["eta_cog"].std())
    u = sigma * np.array([0.01, 2.0, 60.0])
    found = chain.observed.with_delayed(np.stack([0 * u, u], axis=1))[:, 2:]
    expected = np.stack([u**q / (1 + u**2 / (36 * sigma**2)) ** ((q - 1) / 2) for q in (2, 3)], 1)
    assert_allclose(found, expected, rtol=1e-12)  # rounding
    assert_allclose(found[2] / u[2], [6 * sigma, 36 * sigma**2], rtol=0.01)  # 36/60²


def test_slow_squares_above_those_of_training_grow_by_seven_tenths(drift):
    chain = fitted(drift, chosen=(SlowSquares("eta_cog", orders=(0,), lags=(0,)),))
    waves = table(drift, INPUTS)
    inside = chain.observed.direct(waves)[:, 0]
    top = np.nanmax(inside)
    twice = chain.observed.direct(np.sqrt(2.0) * waves)[:, 0]
    expected = np.where(2 * inside > top, top + 0.7 * (2 * inside - top), 2 * inside)
    assert_allclose(twice, expected, rtol=1e-12)
    assert (2 * inside > top).any()
