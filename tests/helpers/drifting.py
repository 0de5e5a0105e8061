"""A synthetic run of a vessel that drifts in irregular waves, past two probes."""

import numpy as np
from records import record, rms
from seas import Sea

from seakeep import Powers, ProbeAlignment, SlowSquares

DT, DEPTH = 0.1, 3.6
POSITIONS = {"eta_fwd": 48.42, "eta_cog": 52.09}
STATES, INPUTS = ["surge", "heave"], ["eta_fwd", "eta_cog"]
LINE, LOAD_NOISE = -1.33, 0.5  # m from the last probe, N
FOLLOWED = ProbeAlignment(mode="dispersion", surge="predicted")
SQUARES = SlowSquares("eta_fwd", orders=(0,), lags=(0, 1))
OBSERVABLES = SlowSquares("eta_cog", cutoff=1.0, lead=0.75, lags=(0, 1)), Powers(INPUTS)


def drifting_run(seed=0, samples=1500, moved=0.0):
    """Heave answers the elevation where the vessel is; surge drifts slowly over half a wavelength.

    The load of a bow line is 30 − 2 surge + 5 heave and, where the wave at `LINE` is above half
    its standard deviation, 200 times what it is above, N.

    The surge is an oscillation, which a model with state delays continues; the probes may stand
    `moved` metres downstream of their stated places.
    """
    rng = np.random.default_rng(seed)
    time = DT * np.arange(samples)
    f = rng.uniform(0.3, 0.9, 40)
    amplitude = 0.02 * np.exp(-((f - 0.5) ** 2) / 0.02)
    waves = Sea(f, amplitude, rng.uniform(0, 2 * np.pi, 40), DEPTH)
    surge = 0.6 * np.sin(2 * np.pi * time / 25 + rng.uniform(0, 6.28))

    vessel = POSITIONS["eta_cog"] + surge
    heave = 0.8 * waves.at(time - 0.2, vessel) + 0.4 * waves.at(time - 0.5, vessel)
    noise, spread = 1e-4, np.sqrt(np.sum(amplitude**2) / 2)
    load = 30.0 - 2.0 * surge + 5.0 * heave
    load += 200.0 * np.maximum(waves.at(time, POSITIONS["eta_cog"] + LINE) - 0.5 * spread, 0.0)
    channels = {
        "surge": surge + noise * rng.standard_normal(samples),
        "heave": heave + noise * rng.standard_normal(samples),
        **{key: waves.at(time, x + moved) for key, x in POSITIONS.items()},
        "mooring_bow": load + LOAD_NOISE * rng.standard_normal(samples),
    }
    run = record(DT, {"water_depth": DEPTH, "run": "run", "encounter_period": 1.5}, **channels)
    for key, x in POSITIONS.items():
        run[key].attrs["x_position"] = x
    return run


def drifting_runs(count, *more):
    """So many of them, by their names."""
    return {f"run{seed}": drifting_run(seed, *more) for seed in range(1, count + 1)}


def away(run, by):
    """The run, whose surge counts from another place."""
    return run.assign(surge=(run["surge"] + by).assign_attrs(units="m"))


def heave_error(model, run):
    """Error of the heave of a forecast of 300 steps, of the SD of what was measured."""
    forecast = model.forecast(run, start=60.0, steps=300)
    measured = run["heave"].sel(time=forecast["time"])
    return rms(forecast["heave"] - measured) / float(measured.std())
