"""The door of all public functions: arrays of real numbers, or a message of ours."""

import contextlib
import inspect

import numpy as np
import pytest
import xarray as xr

from seakeep import core, metrics, signals, statistics, waves
from seakeep.arrays import as_bundle, as_real, as_series, fraction, number, positive, whole_number
from seakeep.errors import DataError, RequestError, SeakeepError

T = np.arange(0, 60, 0.05)
X = np.sin(2.0 * T) + 0.3 * np.sin(3.1 * T + 1.0)
Y = np.sin(2.0 * (T - 0.3)) + 0.3 * np.sin(3.1 * (T - 0.3) + 1.0)
VECTORS = np.stack([0.1 * X, 0.1 * Y, 0.1 * X], axis=1)
PULSES = np.where(T % 10 < 0.5, 1.0, 0.0)
TABLE = np.stack([X, Y], axis=1)
RNG = np.random.default_rng


def both(call):
    return lambda predicted, measured: call(predicted=predicted, measured=measured)


# Name: the function of its array arguments, and sound ones.
def identified(states, inputs):
    windows = [core.training_window(900, None, 2, 3, "before")]
    return core.identify([states], [inputs], windows, state_delays=2, input_delays=3, ridge=1.0)


CALLS = {
    "core.embed": (lambda x: core.embed(x, 2, 2, 900), TABLE),
    "core.identify": (identified, TABLE, X[:, None]),
    "core.rollout": (
        core.rollout, np.full((1, 2), 0.3), np.full((1, 2), 0.5), np.ones((3, 2)),
        np.ones((3, 9, 2)),
    ),
    "core.snapshot_matrices": (
        lambda x, u: core.snapshot_matrices(
            x, u, core.training_window(900, None, 2, 3, "before"), 2, 3, all_rows=True
        ),
        TABLE, X[:, None],
    ),
    "core.unembed": (lambda x: core.unembed(x, 2), TABLE.T),
    "signals.band_pass": (lambda x: signals.band_pass(x, 0.05, (0.1, 2.0)), X),
    "signals.bridge": (lambda x: signals.bridge(x, 0.05, 1.0), X),
    "signals.clock_from_correlation": (
        lambda a, c, b, t: signals.clock_from_correlation(a, c, b, t, 10.0, 1.0),
        Y, T, X, T,
    ),
    "signals.clock_from_pulses": (signals.clock_from_pulses, PULSES, T, PULSES, T),
    "signals.clock_from_shared": (signals.clock_from_shared, X, T, X, T),
    "signals.complementary_filter": (
        lambda x, a: signals.complementary_filter(x, a, 0.05, 0.1), X, Y,
    ),
    "signals.compare_motion": (signals.compare_motion, X, T, Y, T),
    "signals.correlation_peak": (
        lambda x, y: signals.correlation_peak(x, y, 0.05, (0.0, 1.0)), X, Y,
    ),
    "signals.delay_by_celerity": (
        lambda x, d: signals.delay_by_celerity(x, 0.05, d, 3.0), X, np.full(T.size, 0.5),
    ),
    "signals.delay_by_dispersion": (
        lambda x, d: signals.delay_by_dispersion(x, 0.05, d, 3.6), X, np.full(T.size, 0.5),
    ),
    "signals.differentiate": (lambda x: signals.differentiate(x, 0.05), X),
    "signals.effective_celerity": (
        lambda x, y: signals.effective_celerity(x, y, 0.05, 1.2, 3.6), X, Y,
    ),
    "signals.encounter_period": (lambda x: signals.encounter_period(x, 0.05), X),
    "signals.envelope_squared": (lambda x: signals.envelope_squared(x, 0.05), X),
    "signals.find_leakage": (lambda x, y: signals.find_leakage([x], y, 0.05), X, X),
    "signals.inspect_times": (signals.inspect_times, T),
    "signals.integrate": (lambda x: signals.integrate(x, 0.05, (0.1, 2.0)), X),
    "signals.low_pass": (lambda x: signals.low_pass(x, 0.05, 2.0), X),
    "signals.misplaced_probes": (
        lambda x, y: signals.misplaced_probes({"a": x, "b": y}, {"a": 0.0, "b": 1.0}, 0.05, 3.6),
        X, Y,
    ),
    "signals.onto_uniform": (signals.onto_uniform, T, X),
    "signals.predict_waves": (lambda x: signals.predict_waves(x, 20), X),
    "signals.peak_period": (lambda x: signals.peak_period(x, 0.05), X),
    "signals.phase_celerity": (lambda x, y: signals.phase_celerity(x, y, 0.05, 1.2, 3.6), X, Y),
    "signals.probe_separation": (
        lambda x, y: signals.probe_separation(x, y, 0.05, 3.6, 1.2), X, Y,
    ),
    "signals.remove_gravity": (signals.remove_gravity, VECTORS, VECTORS),
    "signals.resample": (lambda x, t, u: signals.resample(x, t, u), X, T, T[10:-10] + 0.01),
    "signals.rotation_matrix": (signals.rotation_matrix, VECTORS),
    "signals.significant_height": (signals.significant_height, X),
    "signals.transfer_acceleration": (
        signals.transfer_acceleration, VECTORS, VECTORS, VECTORS, VECTORS, np.ones(3),
    ),
    "signals.transfer_position": (signals.transfer_position, VECTORS, VECTORS, np.ones(3)),
    "signals.transfer_velocity": (
        signals.transfer_velocity, VECTORS, VECTORS, VECTORS, np.ones(3),
    ),
    "signals.uniform_step": (signals.uniform_step, T),
    "signals.wave_heights": (lambda x: signals.wave_heights(x, 0.05), X),
    "signals.wave_spectrum": (lambda x: signals.wave_spectrum(x, 0.05), X),
    "signals.wave_statistics": (lambda x: signals.wave_statistics(x, 0.05), X),
    "signals.waves_part": (lambda x: signals.waves_part(x, 0.05), X),
    "signals.windowed_lags": (lambda x, y: signals.windowed_lags(x, y, 0.05, 10.0, 1.0), X, Y),
    "signals.zero_up_crossings": (lambda x: signals.zero_up_crossings(x, 0.05), X),
    "statistics.band_error_over_time": (
        lambda p, m: statistics.band_error_over_time(
            predicted=p, measured=m, dt=0.05, frequency=0.2
        ),
        TABLE, TABLE,
    ),
    "statistics.band_scores": (statistics.band_scores, TABLE - 1, TABLE + 1, TABLE),
    "statistics.block_length": (
        lambda x: statistics.block_length(x, "encounter_periods", periods=1.0), X,
    ),
    "statistics.box_statistics": (statistics.box_statistics, X),
    "statistics.choose_block_length": (statistics.choose_block_length, X),
    "statistics.conformal_margin": (statistics.conformal_margin, TABLE[None]),
    "statistics.coverage": (statistics.coverage, TABLE - 1, TABLE + 1, TABLE),
    "statistics.coverage_table": (
        statistics.coverage_table, TABLE - 1, TABLE + 1, TABLE,
    ),
    "statistics.band_crps": (statistics.band_crps, TABLE - 1, TABLE + 1, TABLE),
    "statistics.winkler_score": (statistics.winkler_score, TABLE - 1, TABLE + 1, TABLE),
    "statistics.density_grid": (statistics.density_grid, X, Y),
    "statistics.density_interval": (
        lambda x: statistics.density_interval(x, block_length=9, rng=RNG(0), n_series=3), X,
    ),
    "statistics.jensen_shannon": (statistics.jensen_shannon, np.abs(X), np.abs(Y)),
    "statistics.jsd_interval": (
        lambda x, y: statistics.jsd_interval(x, y, block_length=9, rng=RNG(0), n_series=3), X, Y,
    ),
    "statistics.kernel_bandwidth": (statistics.kernel_bandwidth, X),
    "statistics.kernel_density": (statistics.kernel_density, X, np.linspace(-3, 3, 50)),
    "statistics.lag_one_correlation": (statistics.lag_one_correlation, X),
    "statistics.moving_block_bootstrap": (
        lambda x: statistics.moving_block_bootstrap(x, 2, 9, RNG(0)), X,
    ),
    "statistics.split_bands": (lambda x: statistics.split_bands(x, 0.05, 0.2), TABLE),
    "statistics.two_way_interval": (
        lambda a, b: statistics.two_way_interval(
            lambda x, y: x.mean(axis=(1, 2)), a, b, rng=RNG(0), n_series=9
        ),
        TABLE[:9], TABLE[9:18],
    ),
    "statistics.trend_test": (
        lambda x, t: statistics.trend_test(
            x, rng=RNG(0), time=t, n_series=3, block_length=9
        ), X, T,
    ),
    "waves.group_speed": (waves.group_speed, np.abs(X), np.full(T.size, 3.6)),
    "waves.phase_speed": (waves.phase_speed, np.abs(X), np.full(T.size, 3.6)),
    "waves.wavelength_to_frequency": (
        waves.wavelength_to_frequency, 1 + np.abs(X), np.full(T.size, 3.6),
    ),
    "waves.wavenumber": (waves.wavenumber, np.abs(X), np.full(T.size, 3.6)),
    **{
        f"metrics.{name}": (both(getattr(metrics, name)), TABLE, TABLE)
        for name in metrics.__all__
        if name not in ("Measure", "anrmse_differences", "labelled")
    },
}  # fmt: skip
# Of no array: settings, a file, Datasets, units, clocks, results of others.
WITHOUT_ARRAYS = {
    "signals.contact_sheet", "signals.froude_factor", "signals.lowpass_taps",
    "signals.pool_drift", "signals.track_video", "metrics.labelled", "metrics.anrmse_differences",
    "core.training_window", "statistics.overlap_block",
}  # fmt: skip
ROOMS = {
    "core": core,
    "signals": signals,
    "statistics": statistics,
    "metrics": metrics,
    "waves": waves,
}


def masked(x):
    mask = np.zeros(x.shape, dtype=bool)
    mask.flat[x.size // 3 : x.size // 3 + 5] = True
    return np.ma.MaskedArray(x, mask)


def ragged(x):
    return [[1.0, 2.0], [3.0], *x.ravel()[:3].tolist()]


BAD = {
    "masked": masked,
    "complex": lambda x: x + 1j,
    "datetime64": lambda x: np.asarray(x * 1e3).astype("datetime64[ms]"),
    "timedelta64": lambda x: np.asarray(x * 1e3).astype("timedelta64[ms]"),
    "text": lambda x: x.astype(str),
    "a word": lambda x: "heave",
    "nothing": lambda x: None,
    "objects": lambda x: np.where(x > np.median(x), x.astype(object), None),
    "a Dataset": lambda x: xr.Dataset({"heave": ("time", x.ravel())}),
    "ragged": ragged,
}
CASES = [
    pytest.param(name, place, id=f"{name}-{place}")
    for name, (_, *arguments) in CALLS.items()
    for place in range(len(arguments))
]


def test_every_public_function_is_in_the_list():
    functions = {
        f"{room}.{name}"
        for room, module in ROOMS.items()
        for name in module.__all__
        if inspect.isfunction(getattr(module, name))
    }
    assert functions == set(CALLS) | WITHOUT_ARRAYS


@pytest.mark.parametrize("name", CALLS)
def test_sound_arguments_pass(name):
    call, *arguments = CALLS[name]
    call(*arguments)


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize(("name", "place"), CASES)
def test_what_is_no_array_of_real_numbers_is_refused(name, place, kind):
    call, *arguments = CALLS[name]
    arguments[place] = BAD[kind](arguments[place])
    if kind == "nothing" and name == "statistics.trend_test" and place == 1:
        return  # None counts samples
    if kind == "a Dataset" and name == "statistics.moving_block_bootstrap":
        return
    with pytest.raises(SeakeepError):
        call(*arguments)


@pytest.mark.parametrize(
    "kind", ["three axes", "one number", "two samples", "empty", "NaN", "huge"]
)
@pytest.mark.parametrize(("name", "place"), CASES)
def test_other_shapes_and_gaps_are_taken_or_refused_in_words(name, place, kind):
    """No error of NumPy's or SciPy's reaches the user, and no warning."""
    call, *arguments = CALLS[name]
    sound = arguments[place]
    arguments[place] = {
        "three axes": np.stack([np.stack([sound, sound], axis=-1)] * 2, axis=-1),
        "one number": 3.0,
        "two samples": sound[:2],
        "empty": sound[:0],
        "NaN": np.full(sound.shape, np.nan),
        "huge": 1e200 * sound,
    }[kind]
    with contextlib.suppress(SeakeepError):
        call(*arguments)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (masked(X), r"x holds 5 masked value\(s\).* numpy\.ma\.filled"),
        ([masked(X), X], r"x holds 5 masked value\(s\)"),
        (X + 1j, r"x must be real numbers; received ndarray of type complex128. Give its real"),
        (T.astype("datetime64[s]"), r"type datetime64\[s\]. Give seconds: \(t - t\[0\]\)"),
        (["a", "b"], r"received list of type <U1. Convert the text to numbers"),
        (xr.Dataset(), r"received a Dataset. Select one channel: data\['heave'\]"),
        ([[1.0], [1.0, 2.0]], r"rows of unequal length"),
        ([1.0, None], r"type object. Convert every value to a number, gaps to NaN"),
    ],
)
def test_what_the_message_says(values, message):
    with pytest.raises(RequestError, match=message):
        as_real(values, "x")


def test_what_is_taken_as_it_is():
    np.testing.assert_array_equal(as_real(np.ma.MaskedArray(X), "x"), X)
    np.testing.assert_array_equal(as_real(xr.DataArray(X), "x"), X)
    np.testing.assert_array_equal(as_real([True, 2, np.float32(3)], "x"), [1, 2, 3])
    assert as_real(X, "x") is X


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: as_series(3.0), RequestError, r"shape \(\); expected \(time,\)"),
        (lambda: as_series(TABLE), RequestError, r"shape \(1200, 2\); expected \(time,\)"),
        (lambda: as_series([1.0]), DataError, r"has 1 sample\(s\); at least 2 are needed"),
        (lambda: as_series([1.0, np.inf]), DataError, "1 value.*, of 2, the first at sample 1"),
        (lambda: as_series([1.0, -1e160]), DataError, "values beyond 1e.150.* damaged row"),
        (
            lambda: metrics.nrmse(predicted=TABLE, measured=1e160 * TABLE),
            DataError,
            "measured holds values beyond 1e.150",
        ),
        (lambda: as_bundle(TABLE[None]), RequestError, r"expected \(time,\) or \(series, time\)"),
        (lambda: number("3", "x"), RequestError, "x must be a number; received '3'"),
        (lambda: number(np.datetime64("2020"), "x"), RequestError, "x must be a number"),
        (lambda: number(np.ma.masked, "x"), RequestError, "x must be a number"),
        (lambda: number([1.0, 2.0], "x"), RequestError, "x must be a number"),
        (lambda: positive(0.0, "dt", "s"), RequestError, r"dt must be positive \(s\)"),
        (lambda: positive(np.inf, "dt", "s"), RequestError, r"dt must be positive \(s\)"),
        (lambda: fraction(1.0, "level"), RequestError, "level must lie between 0 and 1"),
        (lambda: whole_number(2.0, "n"), RequestError, "n must be a whole number of at least 1"),
    ],
)
def test_single_numbers_and_shapes(call, error, message):
    with pytest.raises(error, match=message):
        call()
