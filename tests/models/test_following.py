"""The recursion: a model that carries waves to where its own surge takes the vessel."""

from dataclasses import replace

import numpy as np
import pytest
from drifting import FOLLOWED, INPUTS, OBSERVABLES, STATES, away, heave_error
from numpy.testing import assert_allclose, assert_array_equal
from records import table
from said import data_error, warned

from seakeep import HankelDMDc
from seakeep.core.recursion import Place, Recursion, recursion
from seakeep.models.calibration import envelope_of
from seakeep.models.labelled import Span

SPEC = HankelDMDc(
    10, 40, 1e-3, delay_rows="exact", alignment=FOLLOWED, lead=12, observables=OBSERVABLES
)


@pytest.fixture(scope="module")
def models(drifts):
    return {
        name: each.fit(drifts, STATES, INPUTS)
        for name, each in {"ahead": SPEC, "now": replace(SPEC, lead=0, observables=())}.items()
    }


def test_the_wave_is_read_where_the_vessel_goes(models, drift):
    """As in `test_alignment.py`, with waves ahead and columns of their own."""
    assert heave_error(models["ahead"], drift) < 0.12  # what the forecast of surge is off


def test_settings_know_the_history_that_carriers_read(models, drift):
    model, period = models["now"], drift.attrs["encounter_period"]
    assert model.history_samples == model.settings.needs(model.dt, period).history + 1
    # Centred, carriers read ahead in place of the map, whatever its look-ahead.
    centred = replace(SPEC, centre=40, observables=()).fit(drift, STATES, INPUTS)
    assert centred.history_samples == centred.settings.needs(centred.dt, period).history + 1


def test_bands_take_the_waves_at_the_place_of_the_start(models, drift):
    model, run = models["ahead"], drift
    windows = model.read_windows(run, [60.0, 80.0], 50)
    assert windows.delayed.shape == (2, 40 + 50, 6)
    found = envelope_of(model.signature, windows)
    still = run.copy(deep=True)
    still["surge"].values[:] = 0.0
    other = envelope_of(model.signature, model.read_windows(still, [60.0], 50))
    assert found.shape == (2, 50)
    assert np.all((found > 0.2) & (found < 3))  # SD of the waves of training
    assert not np.allclose(found[0], other[0], rtol=1e-3)


def test_a_surge_in_other_units_than_metres_is_refused(drifts):
    far = [run.assign(surge=run["surge"] * 1000.0) for run in drifts]
    with data_error(
        r" 1200 m in training, 2[0-9]{2} wavelengths\. Check that 'surge' is in metres"
    ):
        SPEC.fit(far, STATES, INPUTS)
    stated = [run.assign(surge=run["surge"].assign_attrs(units="cm")) for run in drifts]
    with data_error("channel 'surge' of run is in 'cm' and the model expects 'm'"):
        SPEC.fit(stated, STATES, INPUTS)


def test_a_ridge_weighs_a_hundred_times_on_powers(models):
    scale = models["ahead"].signature.input_scale
    assert_allclose(scale.std / scale.spread, [1, 1, 10, 10, 10, 10])  # √100


def test_training_is_the_recursion_on_the_measured_surge(models, drift):
    input_map, surge = models["ahead"].signature.input_map, drift["surge"].values
    later = surge.copy()
    later[560:] = 9.0
    drives = [
        input_map.drive(table(drift, INPUTS), [Span(500, 500, 600)], run=drift, surge=each)
        for each in (surge, later)
    ]
    found, other = (drive.rows(500, 600) for drive in drives)
    assert_array_equal(other.delayed[:60], found.delayed[:60])
    assert not np.allclose(other.delayed[60:], found.delayed[60:])
    away = drives[0].places(500, 600) - input_map.follows.place.centre
    assert_array_equal(found.direct[:, -1], away**2)


def test_a_step_is_the_equation():
    """x' = A x̂ + B û + D v, of models and windows side by side and of one alone."""
    rng = np.random.default_rng(0)
    N, s, n, z, P, places, steps = 2, 3, 2, 4, 5, 9, 30
    place = Place(np.full(P, 1 / P), -1.0, 0.25, places, 0.1)
    a, b, d = (0.1 * rng.standard_normal((3, N, each)) for each in (N * (s + 1), n * (z + 1), 1))
    gain, offset = np.array([0.7, 0.6, 0.5]), np.array([0.2, 0.1, -0.1])
    # So wide that the vessel leaves the grid at both ends.
    histories, delayed = 9 * rng.standard_normal((3, 2, 6, N)), rng.standard_normal((2, z, n))
    table, starts = rng.standard_normal((60, places, n)), np.array([0, 25])
    forcing = rng.standard_normal((3, 2, steps, N))

    def run(of, at, forcing):
        """States and inputs of some models from some windows on."""
        models = Recursion(a[of], b[of], d[of, :, 0], gain[of], offset[of], 1)
        given = histories[of, at], delayed[at], table, starts[at], forcing[of, at]
        return recursion(models, place, *given)

    found, used = run(slice(3), slice(2), forcing)
    for model, window in np.ndindex(3, 2):
        x, u = list(histories[model, window]), list(delayed[window])
        for step in range(steps):
            surge = offset[model] + gain[model] * np.array(x[-P:])[:, 1]
            here = np.clip(surge.mean(), -1.0, 1.0)
            waves = table[starts[window] + step].T
            u.append(np.array([np.interp(here, place.grid, each) for each in waves]))
            x.append(
                a[model] @ np.concatenate(x[: -s - 2 : -1])
                + b[model] @ np.concatenate(u[: -z - 2 : -1])
                + d[model, :, 0] * (here - 0.1) ** 2
                + forcing[model, window, step]
            )
        # One window of one model runs by numbers, not by arrays.
        alone = run(slice(model, model + 1), slice(window, window + 1), forcing)
        one = [each[0, 0] for each in alone]
        for states, inputs in ((found[model, window], used[model, window]), one):
            assert_allclose(states, x[6:], rtol=1e-10, atol=1e-12)
            assert_allclose(inputs, u[z:], rtol=1e-10, atol=1e-12)
    lost = np.where(np.arange(steps)[:, None] < 20, forcing, np.nan)
    for of in (slice(1), slice(3)):  # a run that is lost stays so, and keeps a place
        one, driven = run(of, slice(1), lost)
        assert_array_equal(np.isnan(one), np.isnan(lost[of, :1]))
        assert np.isfinite(driven).all()


def test_who_drifts_no_farther_than_in_training_is_to_read_further_ahead(drifts, drift):
    # Training goes to −1.9 m; without a look-ahead carriers know the waves to −1.5 m.
    spec = replace(SPEC, lead=0, observables=())
    model = spec.fit([away(run, -1.3) for run in drifts], STATES, INPUTS)
    with warned(
        r"lies beyond -1\.\d+ to .* m, where the carriers know .* waves\. Read further ahead"
    ):
        model.forecast(away(drift, -1.3), start=60.0, steps=300)
    with warned(
        r"know the waves\. Train on runs that drift as far, read further ahead \(lead\), or"
    ):
        model.forecast(away(drift, -4.0), start=60.0, steps=300)
