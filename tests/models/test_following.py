"""The recursion: a model that carries waves to where its own surge takes the vessel."""

from dataclasses import replace

import numpy as np
import pytest
from drifting import DT, INPUTS, STATES, drifting_run

from seakeep import (
    HankelDMDc,
    Powers,
    ProbeAlignment,
    RequestError,
    SlowSquares,
)
from seakeep.core.recursion import Place, Recursion, recursion
from seakeep.models.calibration import envelope_of
from seakeep.models.labelled import Span

FOLLOWED = ProbeAlignment(mode="dispersion", surge="predicted")
OBSERVABLES = (
    SlowSquares("eta_cog", cutoff=1.0, lead=0.75, lags=(0, 1)),
    Powers(("eta_fwd", "eta_cog")),
)
SPEC = HankelDMDc(
    10, 40, 1e-3, delay_rows="exact", alignment=FOLLOWED, lead=12, observables=OBSERVABLES
)


@pytest.fixture(scope="module")
def models():
    runs = [drifting_run(seed) for seed in (1, 2)]
    return {
        name: each.fit(runs, STATES, INPUTS)
        for name, each in {
            "ahead": SPEC,
            "now": replace(SPEC, lead=0, observables=()),
            "rest": replace(SPEC, alignment=None),
        }.items()
    }


def table_of(run, names):
    return np.stack([run[name].values for name in names], axis=1)


def heave_error(model, run):
    forecast = model.forecast(run, start=60.0, steps=300)
    measured = run["heave"].sel(time=forecast["time"])
    return float(np.sqrt(np.mean((forecast["heave"] - measured) ** 2)) / measured.std())


def test_the_wave_is_read_where_the_vessel_goes(models):
    errors = {name: heave_error(model, drifting_run(7)) for name, model in models.items()}
    assert errors["ahead"] < 0.12  # what the forecast of surge is off
    assert errors["now"] < 0.2  # and what a probe 3.7 m up-wave does not tell
    assert errors["rest"] > 0.35


def test_settings_know_the_history_that_carriers_read(models):
    model, period = models["now"], drifting_run(7).attrs["encounter_period"]
    assert model.history_samples == model.settings.needs(DT, period).history + 1


def test_a_step_is_the_equation(models):
    """x' = A x̂ + B û + D v with each part computed by itself, as a host does."""
    model, run, start = models["ahead"], drifting_run(7), 600
    signature, x, u = model.signature, table_of(run, STATES), table_of(run, INPUTS)
    follows, observed = signature.input_map.follows, signature.input_map.observed
    z, taps = signature.input_delays, follows.place.taps
    rows = []
    for at in range(start - z, start + 1):
        surge = x[at - taps.size + 1 : at + 1, 0][::-1]
        place = float(np.clip(taps @ surge, follows.place.grid[0], follows.place.grid[-1]))
        on_grid = (place - follows.place.lowest) / follows.place.spacing
        below = int(on_grid)
        sides = []
        for side in (below, below + 1):
            wave = [
                np.sum(
                    bank.taps[side] * u[at - follows.back : at + follows.ahead + 1, bank.columns].T
                )
                for bank in follows.banks(None)
            ]
            sides.append(observed.with_delayed(np.array([wave]))[0])
        part = on_grid - below
        rows.append((1 - part) * sides[0] + part * sides[1])
    direct = observed.direct(u)[start]
    direct = np.append(direct, (place - follows.place.centre) ** 2)
    regressors = np.concatenate(
        [
            signature.state_scale.deviations(x[start - 10 : start + 1])[::-1].ravel(),
            signature.input_scale.deviations(np.array(rows))[::-1].ravel(),
            signature.direct_scale.deviations(direct),
        ]
    )
    expected = signature.state_scale.physical(model.coefficients @ regressors)
    found = model.forecast(run, start=start * DT, steps=1)
    np.testing.assert_allclose([found[each].values[0] for each in STATES], expected, atol=1e-12)


def test_bands_take_the_waves_at_the_place_of_the_start(models):
    model, run = models["ahead"], drifting_run(7)
    windows = model.read_windows({"a": run}, [("a", 60.0), ("a", 80.0)], 50)
    assert windows.delayed.shape == (2, 40 + 50, 6)
    found = envelope_of(model.signature, windows)
    still = run.assign(surge=("time", np.full(run.sizes["time"], 0.0), run["surge"].attrs))
    other = envelope_of(model.signature, model.read_windows({"a": still}, [("a", 60.0)], 50))
    assert found.shape == (2, 50)
    assert np.all((found > 0.2) & (found < 3))  # SD of the waves of training
    assert not np.allclose(found[0], other[0], rtol=1e-3)
    with pytest.raises(RequestError, match="where its own surge takes it, which no linear system"):
        model.initial_state(run, 60.0)


def test_a_ridge_weighs_a_hundred_times_on_powers(models):
    scale = models["ahead"].signature.input_scale
    np.testing.assert_allclose(scale.std / scale.spread, [1, 1, 10, 10, 10, 10])  # √100


def test_training_is_the_recursion_on_the_measured_surge(models):
    model, run = models["ahead"], drifting_run(1)
    surge = run["surge"].values
    later = surge.copy()
    later[560:] = 9.0
    found, other = (
        model.signature.input_map.drive(
            table_of(run, INPUTS), [Span(500, 500, 600)], run=run, surge=each
        ).rows(500, 600)
        for each in (surge, later)
    )
    np.testing.assert_array_equal(other.delayed[:60], found.delayed[:60])
    assert not np.allclose(other.delayed[60:], found.delayed[60:])


def test_models_and_windows_side_by_side_are_each_alone():
    rng = np.random.default_rng(0)
    N, s, n, z, P, places, steps = 2, 3, 2, 4, 5, 9, 30
    place = Place(np.full(P, 1 / P), -1.0, 0.25, places, 0.1)
    a, b, d = (0.1 * rng.standard_normal((3, N, each)) for each in (N * (s + 1), n * (z + 1), 1))
    models = Recursion(a, b, d[..., 0], 0.7, 0.2, 1)
    # So wide that the vessel leaves the grid at both ends.
    histories, delayed = 9 * rng.standard_normal((2, 6, N)), rng.standard_normal((2, z, n))
    table, starts = rng.standard_normal((60, places, n)), np.array([0, 25])
    forcing = rng.standard_normal((3, 2, steps, N))
    found, used = recursion(models, place, histories, delayed, table, starts, forcing)
    for model in range(3):
        for window in range(2):
            x, u = list(histories[window]), list(delayed[window])
            for step in range(steps):
                surge = [0.2 + 0.7 * each[1] for each in x[-P:]]
                here = min(max(np.mean(surge), -1.0), 1.0)
                row = [
                    np.interp(here, place.grid, table[starts[window] + step, :, column])
                    for column in range(n)
                ]
                u.append(np.array(row))
                following = (
                    a[model] @ np.concatenate(x[: -s - 2 : -1])
                    + b[model] @ np.concatenate(u[: -z - 2 : -1])
                    + d[model, :, 0] * (here - 0.1) ** 2
                    + forcing[model, window, step]
                )
                x.append(following)
            np.testing.assert_allclose(found[model, window], x[6:], rtol=1e-10, atol=1e-12)
            np.testing.assert_allclose(used[model, window], u[z:], rtol=1e-10, atol=1e-12)
            # One window of one model runs by numbers, not by arrays.
            of, at = slice(model, model + 1), slice(window, window + 1)
            alone = Recursion(a[of], b[of], d[of, :, 0], 0.7, 0.2, 1)
            (one,), (driven,) = recursion(
                alone, place, histories[at], delayed[at], table, starts[at], forcing[of, at]
            )
            np.testing.assert_allclose(one[0], x[6:], rtol=1e-10, atol=1e-12)
            np.testing.assert_allclose(driven[0], u[z:], rtol=1e-10, atol=1e-12)
    lost = np.where(np.arange(steps)[:, None] < 20, forcing, np.nan)
    for of in (slice(1), slice(3)):  # a run that is lost stays so, and keeps a place
        alone = Recursion(a[of], b[of], d[of, :, 0], 0.7, 0.2, 1)
        one, driven = recursion(
            alone, place, histories[:1], delayed[:1], table, starts[:1], lost[of, :1]
        )
        np.testing.assert_array_equal(np.isnan(one), np.isnan(lost[of, :1]))
        assert np.isfinite(driven).all()
