"""The input map: alignment, lead and observables, from a measured run to the model's columns."""

import json

import numpy as np
import pytest
import xarray as xr

from seakeep.core.observables import slow_kernel, slow_squares
from seakeep.errors import DataError, RequestError
from seakeep.models.alignment import ProbeAlignment
from seakeep.models.inputs import FittedInputs, fit_inputs
from seakeep.models.observables import OBSERVABLES, Expression, Powers, SlowSquares, from_json

DT, PERIOD = 0.1, 16  # s, samples


def irregular(seed: int = 0, samples: int = 900) -> xr.Dataset:
    """Two probes 2 m apart in deep water, and a surge that wanders."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) * DT
    omega = 2 * np.pi * rng.uniform(0.45, 0.8, 12)
    phase = rng.uniform(0, 2 * np.pi, 12)
    channels = {
        name: (
            "time",
            sum(
                0.01 * np.cos(w * t - w**2 / 9.81 * x + p)
                for w, p in zip(omega, phase, strict=True)
            ),
            {"units": "m", "x_position": x},
        )
        for name, x in (("eta_fwd", 0.0), ("eta_cog", 2.0))
    }
    channels["surge"] = ("time", 0.3 + 0.2 * np.sin(2 * np.pi * t / 40), {"units": "m"})
    attrs = {"water_depth": np.inf, "encounter_period": PERIOD * DT}
    return xr.Dataset(channels, coords={"time": t}, attrs=attrs)


def fitted(
    run: xr.Dataset, lead: int = 12, surge: str = "predicted", **more: object
) -> FittedInputs:
    chosen = [SlowSquares("eta_cog"), Powers(("eta_fwd", "eta_cog"), (2, 3), products=True)]
    return fit_inputs(
        {"run": run},
        ["surge"],
        ["eta_fwd", "eta_cog"],
        None,
        alignment=ProbeAlignment(mode="dispersion", surge=surge),
        lead=lead,
        chosen=more.pop("chosen", chosen),
    )


def test_the_low_pass_filter_keeps_a_constant_and_damps_the_waves():
    kernel = slow_kernel(1 / (3 * PERIOD), 24)
    lag = np.arange(-24, 25)
    gains = [float(kernel @ np.cos(2 * np.pi * f * lag)) for f in (0, 1 / PERIOD, 2 / PERIOD)]
    assert gains[0] == pytest.approx(1, abs=1e-12)  # rounding of a sum of 49 numbers
    assert abs(gains[1]) < 0.03  # the side lobes of the window
    assert abs(gains[2]) < 0.01


def test_slow_squares_are_the_sums_that_they_stand_for():
    rng = np.random.default_rng(1)
    series, kernel = rng.normal(size=80), slow_kernel(0.05, 6)
    found = slow_squares(series, (0, 1, 2), kernel, 3, (0, 5), DT)
    derivatives = [
        lambda j: series[j],
        lambda j: (series[j + 1] - series[j - 1]) / (2 * DT),
        lambda j: (series[j + 1] - 2 * series[j] + series[j - 1]) / DT**2,
    ]
    for row in (20, 41, 60):
        for order, derivative in enumerate(derivatives):
            for place, lag in enumerate((0, 5)):
                middle = row + 3 - lag
                expected = sum(w * derivative(middle - 6 + i) ** 2 for i, w in enumerate(kernel))
                # Rounding of thirteen squares of second differences.
                assert found[row, 2 * order + place] == pytest.approx(expected, rel=1e-12)


def test_slow_squares_of_a_regular_wave_weigh_the_amplitude_by_the_frequency():
    amplitude, omega = 0.05, 2 * np.pi / (PERIOD * DT)
    series = amplitude * np.cos(omega * DT * np.arange(400))
    found = slow_squares(series, (0, 1, 2), slow_kernel(1 / (3 * PERIOD), 24), 0, (0,), DT)[200]
    x = omega * DT
    # A central difference multiplies by sin(x)/x, and the second by (sin(x/2)/(x/2))^2.
    gains = [1.0, np.sin(x) / x, (np.sin(x / 2) / (x / 2)) ** 2]
    for order, gain in enumerate(gains):
        expected = 0.5 * (amplitude * omega**order * gain) ** 2
        # What the filter leaves of the wave at twice the frequency.
        assert found[order] == pytest.approx(expected, rel=0.01)


def test_columns_are_named_with_units_and_stand_in_two_groups():
    inputs = fitted(irregular())
    delayed = {label.name: label.units for label in inputs.delayed}
    assert delayed == {
        "eta_fwd": "m",
        "eta_cog": "m",
        "eta_fwd_power_2": "m^2",
        "eta_cog_power_2": "m^2",
        "eta_fwd_power_3": "m^3",
        "eta_cog_power_3": "m^3",
        "eta_fwd_times_eta_cog": "m m",
    }
    assert len(inputs.direct) == 18
    assert inputs.direct[6].units == "(m/s)^2"
    # The squares look two periods ahead, which is more than the lead of the waves.
    assert inputs.lead_samples == 2 * PERIOD
    # Five periods of lags and twice the filter's half width less the look-ahead.
    assert inputs.history(3 * PERIOD) == 5 * PERIOD + 2 * (24 + 1) - 2 * PERIOD


def test_the_lead_shifts_the_columns_that_take_delays():
    run = irregular()
    inputs = fit_inputs(
        {"run": run}, ["surge"], ["eta_fwd"], None, alignment=None, lead=12, chosen=[]
    )
    samples = slice(100, 200)
    rows = inputs.open(run, "run", [samples]).rows(samples)
    np.testing.assert_array_equal(rows.delayed[:, 0], run["eta_fwd"].values[112:212])
    assert rows.direct.shape == (100, 0)


def test_rows_of_arrays_are_rows_of_the_run():
    run = irregular()
    chosen = [SlowSquares("eta_cog"), Expression("steep", "(eta_fwd - eta_cog)**2")]
    inputs = fit_inputs(
        {"run": run}, ["surge"], ["eta_fwd", "eta_cog"], None, alignment=None, lead=5, chosen=chosen
    )
    samples = slice(300, 400)
    rows = inputs.open(run, "run", [samples]).rows(samples)
    values = np.stack([run[name].values for name in inputs.names], axis=-1)
    arrays = inputs.arrays(values)
    np.testing.assert_allclose(rows.delayed, arrays.delayed[samples], rtol=0, atol=1e-15)
    # The same sums, started at another sample of the convolution.
    np.testing.assert_allclose(rows.direct, arrays.direct[samples], rtol=1e-10)


@pytest.mark.parametrize("surge", ["predicted", "none"])
def test_no_surge_after_the_start_and_no_wave_beyond_the_look_ahead_is_read(surge):
    run = irregular()
    inputs = fitted(run, surge=surge)
    start, steps = 500, 100
    samples = slice(start + 1 - 48, start + steps)

    def rows(source: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
        drive = inputs.open(source, "run", [samples])
        path = drive.path(start, samples) if surge == "predicted" else None
        return drive.rows(samples, path)

    poisoned = run.copy(deep=True)
    poisoned["surge"].values[start + 1 :] = np.nan
    for name in ("eta_fwd", "eta_cog"):
        poisoned[name].values[start + steps + inputs.lead_samples :] = 1e9
    for clean, dirty in zip(rows(run), rows(poisoned), strict=True):
        assert np.isfinite(clean).all()
        np.testing.assert_array_equal(clean, dirty)


def test_the_record_is_carried_once_for_all_windows_and_passes(monkeypatch):
    run, inputs = irregular(), fitted(irregular())
    calls = []
    carry = type(inputs.alignment).carry
    monkeypatch.setattr(
        type(inputs.alignment), "carry", lambda *given: calls.append(1) or carry(*given)
    )
    windows = [slice(s, s + 150) for s in (200, 300, 400)]
    drive = inputs.open(run, "run", windows)
    for samples in windows:
        drive.rows(samples, drive.path(samples.start + 49, samples))
        predicted = np.full(100, 0.4)
        drive.rows(samples, drive.path(samples.start + 49, samples, predicted))
    assert len(calls) == 1


def test_a_held_surge_moves_to_the_prediction_of_the_pass_before():
    run, inputs = irregular(), fitted(irregular())
    samples, start = slice(452, 600), 500
    drive = inputs.open(run, "run", [samples])
    held = drive.path(start, samples)
    followed = drive.path(start, samples, np.full(100, 0.45))
    assert len(held) == len(followed) == drive.reach(samples).stop - drive.reach(samples).start
    # The step to the prediction has passed the low-pass filter after three periods of it.
    assert followed[-1] == pytest.approx(0.45, abs=0.01)
    assert held[-1] == pytest.approx(float(run["surge"][500 - PERIOD : 501].mean()), abs=0.02)


def test_a_map_is_the_same_after_a_round_trip_through_json():
    run, inputs = irregular(), fitted(irregular())
    text = json.dumps(inputs.to_json())
    again = FittedInputs.from_json(json.loads(text), inputs.measured, inputs.dt)
    assert again.to_json() == inputs.to_json()
    samples = slice(300, 400)
    for one, other in zip(
        inputs.open(run, "run", [samples]).rows(samples),
        again.open(run, "run", [samples]).rows(samples),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


def test_a_gap_that_is_needed_is_refused_and_one_beyond_is_not():
    run, inputs = irregular(), fitted(irregular())
    run["eta_fwd"].values[700] = np.nan
    with pytest.raises(DataError, match=r"channel 'eta_fwd' of run has 1 missing"):
        inputs.open(run, "run", [slice(650, 710)]).rows(slice(650, 710))
    rows = inputs.open(run, "run", [slice(300, 500)]).rows(slice(300, 500))
    assert np.isfinite(rows.delayed).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"kind": "squares"}, r"observables: kind must be 'slow_squares'.*received 'squares'"),
        ({"kind": "powers", "of": "eta", "power": 2}, r"powers has no key 'power'.*'powers'"),
        ({"kind": "powers", "of": ["a"], "powers": [1]}, r"integers from 2 to 5; received 1"),
        ({"kind": "slow_squares", "of": ["a"], "cutoff": 0}, r"cutoff must be per encounter"),
        ({"kind": "slow_squares", "of": ["a"], "lags": [0, 0]}, r"each once; received"),
        ({"kind": "slow_squares", "of": []}, r"of must name one or more inputs; received \[\]"),
        ({"kind": "slow_squares"}, r"slow_squares: .*missing 1 required.*'of'"),
    ],
)
def test_a_setting_out_of_range_is_refused(settings, message):
    with pytest.raises(RequestError, match=message):
        from_json(settings)


def test_an_observable_of_an_unknown_input_is_refused():
    with pytest.raises(RequestError, match=r"powers of 'eta_aft': no such input"):
        fitted(irregular(), chosen=[Powers("eta_aft")]).delayed  # noqa: B018


def test_two_columns_of_one_name_are_refused():
    chosen = [Expression("eta_fwd", "eta_cog**2")]
    with pytest.raises(RequestError, match="two inputs or observables make a column 'eta_fwd'"):
        fitted(irregular(), chosen=chosen)


def test_every_kind_of_observable_is_registered_under_its_word():
    assert {kind: made.kind for kind, made in OBSERVABLES.items()} == {
        "slow_squares": "slow_squares",
        "powers": "powers",
        "expression": "expression",
    }
