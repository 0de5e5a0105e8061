"""Models with all that hosts must compute, small enough to compile in a blink."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import xarray as xr
from records import record, table
from scipy import signal

from seakeep import Expression, HankelDMDc, HankelDMDcModel, Powers, ProbeAlignment, SlowSquares
from seakeep.baselines import ARX
from seakeep.hosts import start_rows
from seakeep.models import Live

DT, PERIOD = 0.1, 8  # s, samples
STATES, INPUTS = ["surge", "load"], ["eta", "wave probe"]
OBSERVABLES = (
    SlowSquares(("eta", "wave probe"), orders=(0, 1, 2), lags=(0, 1), period=PERIOD * DT),
    Powers("eta"),
    Powers(("eta", "wave probe"), (4,)),
    Expression("mixed", "cos(9*eta)*abs(`wave probe`)/(1 + square(eta)) - average(-eta, eta**2)"),
    Expression("root", "sqrt(2 + sin(`wave probe`) - 0.1)"),
)


def sea_run(seed):
    """Two probes, a surge that follows them, and the load of a line that falls slack."""
    rng = np.random.default_rng(seed)
    eta, probe = rng.standard_normal((2, 402)) * 0.3
    surge = signal.lfilter([0.0, 1.0], [1.0, -1.6, 0.7], (0.3 + probe) * eta)
    load = 1e8 * (np.maximum(2.0, 5.0 + 8.0 * surge) + 0.1 * rng.standard_normal(402))  # N
    channels = {"eta": eta, "wave probe": probe, "surge": surge, "load": load}
    return record(DT, **{name: values[2:] for name, values in channels.items()})


@dataclass(frozen=True)
class Case:
    """A model, arrays that it starts from, what it forecasts, and the run."""

    model: HankelDMDcModel
    x_history: np.ndarray
    u: np.ndarray  # rows of the history of a host, then those of the steps
    expected: np.ndarray
    run: xr.Dataset

    @property
    def rows(self):
        """Rows of input before the first step."""
        return len(self.u) - len(self.expected)


def case_of(model, run):
    steps, start = 60, 200
    x = table(run, model.states)
    u = table(run, model.inputs) if model.inputs else np.zeros((len(run.time), 0))
    now, end = start + 1, start + steps + model.lead_samples
    expected = model.forecast_arrays(x[:now], u[:now], u[now:end], steps)
    x_history, u_history = start_rows(model, run, start * DT)
    return Case(model, x_history, np.concatenate([u_history, u[end - steps : end]]), expected, run)


@pytest.fixture
def errors_of_training(monkeypatch):
    """The band of Python is not widened outside the training, as that of C is not."""
    monkeypatch.setattr(Live, "conditions", None)
    monkeypatch.setattr(Live, "consistency_by_state", np.ones((2, 1)))


@pytest.fixture(scope="session")
def cases(drifts, drift):
    runs = {f"run{seed}": sea_run(seed) for seed in range(3)}
    specs = {
        "full": HankelDMDc(3, 6, 1.0, lead=5, observables=OBSERVABLES),
        "short": HankelDMDc(2, 4, 1e-3, memory=21, delay_rows="exact", readouts={"load": "auto"}),
        "arx": ARX(0, 0),
        "powers": HankelDMDc(3, 6, 1.0, observables=[Powers("eta", (2,))]),
    }
    models = {name: spec.fit(runs, STATES, INPUTS) for name, spec in specs.items()}
    autonomous, short = HankelDMDc(4, 0, 1.0, delay_rows="exact"), models["short"]
    models["autonomous"] = autonomous.fit(runs, STATES, [])
    models["unstable"] = replace(short, coefficients=1.3 * short.coefficients)
    made = {name: case_of(model, sea_run(9)) for name, model in models.items()}
    # Of a vessel that drifts: by waves ahead, and by those that the probe up-wave has seen.
    for name, lead in (("following", 12), ("following_now", 0)):
        spec = HankelDMDc(
            4, 12, 1e-3, delay_rows="exact", lead=lead, memory=2 * lead,
            alignment=ProbeAlignment(mode="dispersion", surge="predicted"),
            observables=(SlowSquares("eta_cog", lags=(0, 1), lead=0), Powers("eta_cog")),
            readouts={"mooring_bow": "wave"},
        )  # fmt: skip
        model = spec.fit(drifts, ["surge", "heave", "mooring_bow"], ["eta_fwd", "eta_cog"])
        made[name] = case_of(model, drift)
    return made
