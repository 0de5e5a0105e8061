"""A synthetic moored vessel, linear but for a line that may fall slack."""

import numpy as np
import xarray as xr

DT, PERIOD = 0.1, 10  # s, samples
STATES, INPUTS = ["surge", "heave", "pitch", "mooring_bow", "mooring_stern"], ["eta"]
FLOOR, NOISE = 2.0, 0.5  # N


def moored_run(
    seed: int = 0, samples: int = 700, slack: bool = True, floor: float = FLOOR
) -> xr.Dataset:
    """Surge, heave and pitch are filters of the wave; the stern line is taut where they pull.

    Its load is max(floor, 8 + 20 surge + 4 pitch) with a noise of NOISE, or the same without the
    floor; the bow line is linear.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(samples + 200) * DT
    eta = np.zeros(t.size)
    for _ in range(12):
        eta += 0.1 * np.cos(2 * np.pi * rng.uniform(0.7, 1.3) * t + rng.uniform(0, 2 * np.pi))
    surge, heave, pitch = np.zeros((3, t.size))
    for k in range(2, t.size):
        surge[k] = 1.6 * surge[k - 1] - 0.75 * surge[k - 2] + 0.3 * eta[k - 1]
        heave[k] = 1.5 * heave[k - 1] - 0.8 * heave[k - 2] + 0.2 * eta[k - 1]
        pitch[k] = 1.4 * pitch[k - 1] - 0.7 * pitch[k - 2] + 0.3 * eta[k - 2]
    stern = 8.0 + 20.0 * surge + 4.0 * pitch
    if slack:
        stern = np.maximum(floor, stern)
    bow = 40.0 - 20.0 * surge
    channels = {
        "eta": (eta, "m"),
        "surge": (surge, "m"),
        "heave": (heave, "m"),
        "pitch": (pitch, "rad"),
        "mooring_bow": (bow + NOISE * rng.standard_normal(t.size), "N"),
        "mooring_stern": (stern + NOISE * rng.standard_normal(t.size), "N"),
    }
    return xr.Dataset(
        {
            name: ("time", values[200:], {"units": units})
            for name, (values, units) in channels.items()
        },
        coords={"time": ("time", t[200:] - t[200], {"units": "s"})},
        attrs={"encounter_period": PERIOD * DT, "run": f"run{seed}"},
    )


def moored_runs(count: int = 3, **more) -> dict[str, xr.Dataset]:
    """Several of them."""
    return {f"run{seed}": moored_run(seed, **more) for seed in range(count)}
