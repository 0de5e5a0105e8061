"""What a forecast and an ensemble hold does not grow with what they hand on piece by piece."""

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
