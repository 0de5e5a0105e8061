"""Members that are held give the ensemble's own numbers, from plain arrays that are checked."""

import numpy as np
import pytest
import xarray as xr

import seakeep

STATES, INPUTS, DT = ["heave", "pitch"], ["eta"], 0.1
START, STEPS = 500, 60


def sea(seed=0, samples=900):
    rng = np.random.default_rng(seed)
    time = DT * np.arange(samples)
    angles = np.outer(time, 2 * np.pi * rng.uniform(0.3, 1.0, 30)) + rng.uniform(0, 6.28, 30)
    waves = {"heave": np.cos(angles - 0.4), "pitch": np.sin(angles), "eta": np.cos(angles)}
    return xr.Dataset(
        {
            key: ("time", each.sum(axis=1) + 0.2 * rng.standard_normal(samples), {"units": "m"})
            for key, each in waves.items()
        },
        coords={"time": ("time", time, {"units": "s"})},
        attrs={"run": f"sea {seed}"},
    )


def fitted(delay_rows="exact", ridge=(2, 20), **settings):
    spec = seakeep.BayesianHankelDMDc(
        encounter_period=1.6,
        window=seakeep.Uniform("10 T", "16 T"),
        state_delays=seakeep.Uniform("0.2 T", "0.6 T"),
        input_delays=seakeep.Uniform("0.5 T", "1.5 T"),
        ridge=seakeep.Uniform(*ridge),
        n_members=7,
        delay_rows=delay_rows,
        **settings,
    )
    return spec.fit(sea(), STATES, INPUTS)


@pytest.fixture(scope="module")
def ensemble():
    return fitted().calibrate(sea(3), steps=STEPS)


@pytest.fixture(scope="module")
def held(ensemble):
    return ensemble.hold()


@pytest.fixture
def arrays():
    run = sea(1)
    x = np.stack([run[name].values for name in STATES], axis=1)
    u = run["eta"].values[:, None]
    return {
        "x_history": x[: START + 1],
        "u_history": u[: START + 1],
        "u_future": u[START + 1 : START + STEPS],
    }


@pytest.mark.parametrize("delay_rows", ["exact", "ridge"])
@pytest.mark.parametrize("band", ["members", "calibrated"])
def test_the_numbers_are_those_of_the_ensemble(delay_rows, band, arrays):
    ensemble = fitted(delay_rows).calibrate(sea(3), steps=STEPS)
    found = ensemble.hold().forecast_arrays(**arrays, steps=STEPS, band=band)
    expected = ensemble.forecast_summary(sea(1), DT * START, STEPS, band=band)
    for key in ("mean", "std", "lower", "upper"):
        values = np.stack([expected[name].sel(statistic=key).values for name in STATES], axis=1)
        # The same operations on the same numbers, in another order of windows at most.
        np.testing.assert_allclose(getattr(found, key), values, rtol=1e-12, atol=1e-12)
    assert found.diverged == 0
