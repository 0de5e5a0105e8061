"""Every public function of arrays, with sound arguments."""

import numpy as np

from seakeep import core, metrics, signals, statistics, waves

T = np.arange(0, 60, 0.05)
X = np.sin(2.0 * T) + 0.3 * np.sin(3.1 * T + 1.0)
Y = np.sin(2.0 * (T - 0.3)) + 0.3 * np.sin(3.1 * (T - 0.3) + 1.0)
VECTORS = np.stack([0.1 * X, 0.1 * Y, 0.1 * X], axis=1)
PULSES = np.where(T % 10 < 0.5, 1.0, 0.0)
TABLE = np.stack([X, Y], axis=1)
RNG = np.random.default_rng
NOISE = RNG(0).standard_normal(T.size)


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
    "signals.band_pass": (lambda x: signals.band_pass(x, 0.05, (0.1, 2.0)), X),
    "signals.bridge": (lambda x: signals.bridge(x, 0.05, 1.0), X),
    "signals.carry_by_celerity": (
        lambda x: signals.carry_by_celerity(x, 0.05, (0.0, 0.5), 3.0).at(0.5), X,
    ),
    "signals.carry_by_dispersion": (
        lambda x: signals.carry_by_dispersion(x, 0.05, (0.0, 0.5), 3.6).at(0.5), X,
    ),
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
    "signals.repeated_waves": (
        lambda x, y: signals.repeated_waves({"one": x, "other": y}, 0.05), X, Y,
    ),
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
    "statistics.block_length": (lambda x: statistics.block_length(0 * x + NOISE), X),
    "statistics.box_statistics": (statistics.box_statistics, X),
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
