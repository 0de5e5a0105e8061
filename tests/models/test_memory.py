"""What an ensemble holds does not grow with what it hands on piece by piece."""

import tracemalloc

import numpy as np
from ensembles import few
from records import record

from seakeep.models import engine, forecasts

STATES = [f"x{k}" for k in range(6)]
STEPS = 500


def test_a_summary_does_not_hold_its_members(monkeypatch):
    monkeypatch.setattr(engine, "HELD", 0)
    monkeypatch.setattr(forecasts, "CHUNK", 50_000)
    rng = np.random.default_rng(0)
    eta = rng.standard_normal(2000)
    states = {name: np.convolve(eta, rng.standard_normal(4), "same") for name in STATES}
    run = record(0.1, eta=eta, **states)

    def peak(members):
        """Bytes that a summary of so many members takes at most."""
        ensemble = few(n_members=members).fit(run, STATES, ["eta"], stop=60.0)
        tracemalloc.start()
        try:
            ensemble.forecast_summary(run, start=60.0, steps=STEPS)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(10)
    less, more = peak(10), peak(70)
    series = 8 * STEPS * len(STATES)  # bytes of one member
    # A member leaves its status and its place in the last piece; a tenth of its series is ample.
    assert more - less < 0.1 * 60 * series
