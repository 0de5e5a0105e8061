"""What tests share: runs made of known systems, and what keeps a busy machine from failing them."""

import signal as signals
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, settings
from scipy import linalg, signal

# A process that has to wait for a core says nothing about the code: no example has a time limit.
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")

UNITS = {"heave": "m", "pitch": "rad", "surge": "m", "eta_fwd": "m", "eta_cog": "m"}


def dataset(time: np.ndarray, **channels: np.ndarray) -> xr.Dataset:
    """A run from arrays, with units where the channel has a usual one."""
    return xr.Dataset(
        {
            name: ("time", values, {"units": UNITS.get(name, "1"), "long_name": name.title()})
            for name, values in channels.items()
        },
        coords={"time": ("time", time, {"units": "s", "long_name": "time"})},
    )


def vessel_run(samples: int = 400, seed: int = 0, dt: float = 0.05, first: float = 0.0):
    """Heave and pitch of a vessel in irregular waves at two probes, with measurement noise.

    The noise makes every Gram matrix regular, and the means are not zero.
    """
    rng = np.random.default_rng(seed)
    time = first + dt * np.arange(samples)
    frequency = rng.uniform(0.3, 1.1, 25)
    phase = rng.uniform(0, 2 * np.pi, 25)

    def waves(lag: float) -> np.ndarray:
        return 0.2 * np.cos(2 * np.pi * np.outer(time - lag, frequency) + phase).sum(axis=1)

    eta_fwd, eta_cog = waves(0.0), waves(0.7)
    poles = signal.butter(2, [0.3, 0.9], "bandpass", fs=1 / dt)
    heave = signal.lfilter(*poles, eta_cog) + 0.3
    pitch = 0.2 * signal.lfilter(*poles, np.gradient(eta_fwd, dt)) - 0.05

    def noisy(values: np.ndarray) -> np.ndarray:
        return values + 0.02 * values.std() * rng.standard_normal(samples)

    return dataset(
        time,
        heave=noisy(heave),
        pitch=noisy(pitch),
        eta_fwd=noisy(eta_fwd) + 0.1,
        eta_cog=noisy(eta_cog),
    )


@dataclass(frozen=True)
class Oscillator:
    """A mass, a spring and a damper under a force held over each step; position alone is seen."""

    mass: float = 2.0
    damping: float = 0.5
    stiffness: float = 8.0
    dt: float = 0.25

    @property
    def natural_frequency(self) -> float:
        """Undamped, Hz."""
        return np.sqrt(self.stiffness / self.mass) / (2 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """Part of the critical damping."""
        return self.damping / (2 * np.sqrt(self.stiffness * self.mass))

    @property
    def discrete(self) -> tuple[np.ndarray, np.ndarray]:
        """Exact discretisation of position and velocity, by the matrix exponential."""
        block = np.zeros((3, 3))
        block[0, 1] = 1.0
        block[1] = [-self.stiffness / self.mass, -self.damping / self.mass, 1 / self.mass]
        step = linalg.expm(block * self.dt)
        return step[:2, :2], step[:2, 2]

    @property
    def arx(self) -> np.ndarray:
        """Coefficients (a0, a1, b0, b1) of y' = a0 y + a1 y₋₁ + b0 u + b1 u₋₁.

        Eliminating the velocity (Cayley and Hamilton): a0 = tr F, a1 = −det F, b0 = g₁,
        b1 = F₁₂ g₂ − F₂₂ g₁.
        """
        f, g = self.discrete
        return np.array([np.trace(f), -np.linalg.det(f), g[0], f[0, 1] * g[1] - f[1, 1] * g[0]])

    def run(self, samples: int = 200, seed: int = 0, forced: bool = True) -> xr.Dataset:
        """Position ``heave`` under the random force ``eta_fwd``, from a random start."""
        rng = np.random.default_rng(seed)
        f, g = self.discrete
        force = rng.standard_normal(samples) * forced
        state = np.empty((samples, 2))
        state[0] = 2 * rng.standard_normal(2)
        for k in range(samples - 1):
            state[k + 1] = f @ state[k] + g * force[k]
        return dataset(self.dt * np.arange(samples), heave=state[:, 0], eta_fwd=force)


@pytest.fixture(scope="session")
def make_dataset() -> Callable[..., xr.Dataset]:
    return dataset


@pytest.fixture(scope="session")
def make_run() -> Callable[..., xr.Dataset]:
    return vessel_run


@pytest.fixture
def run() -> xr.Dataset:
    return vessel_run()


@pytest.fixture
def oscillator() -> Oscillator:
    return Oscillator()


@pytest.fixture
def channels() -> dict[str, list[str]]:
    """States and inputs of :func:`vessel_run`, as ``fit`` takes them."""
    return {"states": ["heave", "pitch"], "inputs": ["eta_fwd", "eta_cog"]}


@pytest.fixture
def study_folder(tmp_path: Path) -> Path:
    """A folder with the tutorial's campaign and a study of it."""
    from tutorial_study import put_tutorial

    put_tutorial(tmp_path)
    return tmp_path


@pytest.fixture
def empty_sheet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sheets with empty pictures: tests/report looks at these, and each takes a second or two."""
    pytest.importorskip("matplotlib", reason="the data-quality sheet has figures")
    from seakeep.report import quality_sheet as sheet
    from seakeep.report.style import new_figure

    monkeypatch.setattr(sheet, "quality_figure", lambda run, agreements: new_figure(1, 1))


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """SIGINT as at a terminal, where the tests may have been started with it ignored.

    Processes started meanwhile have it so too: what is ignored is inherited, a handler is not.
    """
    before = signals.signal(signals.SIGINT, signals.default_int_handler)
    yield
    signals.signal(signals.SIGINT, before)
