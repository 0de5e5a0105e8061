"""What tests share: runs made of known systems, and what keeps a busy machine from failing them."""

import importlib.util
import os
import signal as signals

import numpy as np
import pytest
from drifting import drifting_run
from hypothesis import HealthCheck, settings
from records import record
from scipy import signal

# A process that has to wait for a core says nothing about the code: no example has a time limit.
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")


def vessel_run(samples=400, seed=0):
    """Heave and pitch of a vessel in irregular waves at two probes, with measurement noise.

    The noise makes every Gram matrix regular, and the means are not zero.
    """
    rng = np.random.default_rng(seed)
    dt, time = 0.05, 0.05 * np.arange(samples)
    frequency = rng.uniform(0.3, 1.1, 25)
    phase = rng.uniform(0, 2 * np.pi, 25)

    def waves(lag):
        return 0.2 * np.cos(2 * np.pi * np.outer(time - lag, frequency) + phase).sum(axis=1)

    eta_fwd, eta_cog = waves(0.0), waves(0.7)
    poles = signal.butter(2, [0.3, 0.9], "bandpass", fs=1 / dt)
    heave = signal.lfilter(*poles, eta_cog) + 0.3
    pitch = 0.2 * signal.lfilter(*poles, np.gradient(eta_fwd, dt)) - 0.05

    def noisy(values):
        return values + 0.02 * values.std() * rng.standard_normal(samples)

    waves = {"eta_fwd": noisy(eta_fwd) + 0.1, "eta_cog": noisy(eta_cog)}
    run = record(dt, heave=noisy(heave), pitch=noisy(pitch), **waves)
    run["time"].attrs = {"units": "s", "long_name": "time"}
    return run


def pytest_runtest_setup(item):
    """Leave out tests of measured data where there are none."""
    if item.get_closest_marker("data") and not os.environ.get("SEAKEEP_DATA_DIR"):
        pytest.skip("SEAKEEP_DATA_DIR is not set: it names the folder of the measured data")


@pytest.fixture(scope="session")
def make_run():
    return vessel_run


@pytest.fixture
def run():
    return vessel_run()


@pytest.fixture(scope="session")
def drifts():
    """Runs of training of a vessel that drifts; tests change copies of them."""
    return [drifting_run(seed) for seed in (1, 2)]


@pytest.fixture(scope="session")
def drift():
    return drifting_run(7)


@pytest.fixture
def channels():
    """States and inputs of :func:`vessel_run`, as ``fit`` takes them."""
    return {"states": ["heave", "pitch"], "inputs": ["eta_fwd", "eta_cog"]}


@pytest.fixture
def study_folder(tmp_path):
    """A folder with the tutorial's campaign and a study of it."""
    from tutorial_study import put_tutorial

    put_tutorial(tmp_path)
    return tmp_path


@pytest.fixture
def empty_figures(monkeypatch):
    """Empty pictures of runs: tests/report looks at these, and each takes a second or two."""
    if importlib.util.find_spec("matplotlib") is None:
        return
    from seakeep.report import quality_sheet
    from seakeep.report.figures import histories

    for module, name in ((histories, "overlay_figure"), (quality_sheet, "quality_figure")):
        monkeypatch.setattr(module, name, lambda *_: histories.new_figure(1, 1))


@pytest.fixture
def command(capsys):
    """Run a command to the status that is expected: what it printed, and what it said beside it."""
    from seakeep.cli import main

    def run(*words, status=0):
        ended, told = main(list(map(str, words))), capsys.readouterr()
        assert ended == status, told.err
        return told.out, told.err

    return run


@pytest.fixture
def ctrl_c():
    """SIGINT as at a terminal, where the tests may have been started with it ignored.

    Processes started meanwhile have it so too: what is ignored is inherited, a handler is not.
    """
    before = signals.signal(signals.SIGINT, signals.default_int_handler)
    yield
    signals.signal(signals.SIGINT, before)
