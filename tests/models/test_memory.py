"""What a forecast and an ensemble hold does not grow with what they hand on piece by piece."""

import sys
import tracemalloc

import numpy as np
import pytest
import xarray as xr

import seakeep
from seakeep.models import engine, summaries


@pytest.fixture(scope="module")
def run():
    rng = np.random.default_rng(0)
    time = 0.1 * np.arange(130_000)
    eta = rng.standard_normal(time.size)
    states = {f"x{k}": ("time", np.convolve(eta, rng.standard_normal(4), "same")) for k in range(6)}
    return xr.Dataset(states | {"eta": ("time", eta)}, coords={"time": time})


STATES = [f"x{k}" for k in range(6)]


def peak(work):
    tracemalloc.start()
    try:
        result = work()
        return tracemalloc.get_traced_memory()[1], result.nbytes
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("delay_rows", ["exact", "ridge"])
def test_a_long_forecast_holds_little_beside_its_result(run, monkeypatch, delay_rows):
    monkeypatch.setattr(sys.modules["seakeep.core.rollout"], "PIECE", 50_000)
    model = seakeep.HankelDMDc(
        state_delays=4, input_delays=6, ridge=1.0, delay_rows=delay_rows, window=400
    ).fit(run, STATES, ["eta"], stop=100.0)
    model.forecast(run, start=100.0, steps=10)
    (short, small), (long, large) = (
        peak(lambda steps=steps: model.forecast(run, start=100.0, steps=steps))
        for steps in (30_000, 120_000)
    )
    # Seven series are the result; beside them stand three copies of the input, two of a channel
    # and what is lost of it: 12.3/7 = 1.75.
    assert (long - short) / (large - small) < 1.8


def test_a_summary_does_not_hold_its_members(run, monkeypatch):
    monkeypatch.setattr(engine, "HELD", 0)
    monkeypatch.setattr(summaries, "CHUNK", 200_000)

    def summary(members):
        spec = seakeep.BayesianHankelDMDc(
            encounter_period=1.6,
            window=seakeep.Uniform("8 T", "12 T"),
            state_delays=seakeep.Uniform("0.2 T", "0.4 T"),
            input_delays=seakeep.Uniform("0.2 T", "0.4 T"),
            ridge=seakeep.Uniform(1, 2),
            n_members=members,
        )
        ensemble = spec.fit(run.isel(time=slice(2000)), STATES, ["eta"], stop=60.0)
        return peak(lambda: ensemble.forecast_summary(run, start=60.0, steps=1000))[0]

    summary(10)
    few, many = summary(20), summary(160)
    series = 8 * 1000 * len(STATES)  # bytes of one member
    # A member leaves its status and its place in the last piece; a tenth of its series is ample.
    assert many - few < 0.1 * 140 * series
