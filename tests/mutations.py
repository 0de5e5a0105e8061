"""Wrong one-line changes, and the tests that fail on each: `python tests/mutations.py`.

Not collected by pytest. Each change is made in a copy of the project, and its tests run there. A
change with which they pass survives; one whose line or tests are not there is stale. The command
ends with status 1 if there is either. It goes on where it was interrupted: RESULTS holds one line
per change, and a change is tried again once its file or its tests are others.
"""

import argparse
import hashlib
import os
import queue
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from rich.progress import track

ROOT = Path(__file__).parents[1]
# File below src/seakeep, its line (a part of it that stands there once), what replaces it, and the
# tests below tests/ that fail.
CHANGES = (
    ("check/free.py", "linear / np.hypot(2 * np.pi, linear)", "linear / (2 * np.pi)", "check/test_free.py::test_the_decay_of_an_oscillator_is_its_own"),
    ("check/residuals.py", "1.96 / np.sqrt(count)", "1.96 / np.sqrt(count - lags)", "check/test_residuals.py::test_limits_and_past_inputs_are_those_of_the_errors_by_hand"),
    ("check/residuals.py", "inputs = channel_matrix(run, model.inputs, name, after)", "inputs = channel_matrix(run, model.inputs, name, slice(first, last))", "check/test_residuals.py::test_limits_and_past_inputs_are_those_of_the_errors_by_hand"),
    ("core/bootstrap.py", "special.stdtrit(blocks - 1.0, 0.5 + level / 2)", "1.96", "statistics/test_two_way.py::test_the_interval_holds_the_truth_as_often_as_it_says"),
    ("core/calibration.py", "total += 2.0 * correlation", "total += correlation", "statistics/test_calibration.py::test_the_block_is_the_integrated_correlation_time"),
    ("core/decay.py", "p / np.hypot(2 * np.pi, p)", "p / (2 * np.pi)", "check/test_free.py::test_strong_damping_is_no_small_angle"),
    ("core/embedding.py", "last - window + 1", "last - window", "core/test_embedding.py::test_windows_at_the_papers_delays"),
    ("core/embedding.py", "max(first, earliest)", "max(first, earliest) + 1", "core/test_embedding.py::test_windows_at_the_papers_delays"),
    ("core/embedding.py", "reach = max(state_delays, input_delays)", "reach = state_delays", "core/test_embedding.py::test_windows_at_the_papers_delays"),
    ("core/embedding.py", "series[first - lag : first - lag + count]", "series[first - delays + lag : first - delays + lag + count]", "core/test_embedding.py::test_blocks_are_lag_major_the_newest_first"),
    ("core/gram.py", "min(piece.count, delay + 1))", "min(piece.count, delay))", "core/test_fast_paths.py::test_the_trace_is_the_sum_of_squares"),
    ("core/gram.py", "return self.states[self.first + 1 : self.first + 1 + self.count]", "return self.states[self.first : self.first + self.count]", "core/test_fast_paths.py::test_every_form_gives_the_papers_formula"),
    ("core/gram.py", "row[:, other.older] += above[:, other.newer]", "row[:, other.older] += 0.0 * above[:, other.newer]", "core/test_fast_paths.py::test_the_displaced_gram_is_the_gram"),
    ("core/gram.py", "signed[1::2] *= -1.0", "signed[0::2] *= -1.0", "core/test_fast_paths.py::test_the_displaced_gram_is_the_gram"),
    ("core/harmonics.py", "part.std(axis=-2, ddof=1)", "part.std(axis=-2, ddof=0)", "check/test_response.py::test_type_a_uncertainty_is_that_of_the_mean_of_few_windows"),
    ("core/kalman.py", "+ np.diag(self.noise[rows])", "+ np.diag(self.noise[rows] ** 0.5)", "core/test_kalman.py::test_it_is_the_textbook_filter_with_rows_missing"),
    ("core/kalman.py", "after[:kept, :kept] = before[count:, count:]", "after[:kept, :kept] = before[:-count, :-count]", "core/test_kalman.py::test_it_is_the_textbook_filter_with_rows_missing"),
    ("core/kalman.py", "block = top @ self.a.T + self.process", "block = top @ self.a.T", "core/test_kalman.py::test_it_is_the_textbook_filter_with_rows_missing"),
    ("core/kalman.py", "residual - np.diag(noise) - (a * every) @ a.T", "residual - np.diag(noise)", "core/test_kalman.py::test_residuals_less_measurement_noise_are_process_noise"),
    ("core/metrics.py", "NOISE_FACTOR = 2**0.5", "NOISE_FACTOR = 2.0", "test_metrics.py::test_a_channel_is_judged_where_less_than_half_of_its_variance_is_noise"),
    ("core/metrics.py", "load <= noise_std", "load <= 2 * noise_std", "tank/test_quality_on_tank.py::test_the_share_of_a_slack_line_is_that_of_the_truth"),
    ("core/recursion.py", "here -= place.centre", "here -= 0.0", "models/test_following.py::test_models_and_windows_side_by_side_are_each_alone"),
    ("core/recursion.py", "rows + 1, axis=0) - lower)", "rows + 1, axis=0))", "models/test_following.py::test_the_wave_is_read_where_the_vessel_goes"),
    ("core/response.py", "back = turn[:, None] ** -np.arange(input_delays + 1)", "back = turn[:, None] ** np.arange(input_delays + 1)", "check/test_response.py::test_the_response_is_that_of_python_control"),
    ("core/rollout.py", "gone = np.logical_or.accumulate(~finite.all(axis=2), axis=1)", "gone = ~finite.all(axis=2)", "core/test_rollout.py::test_a_window_that_was_given_up_does_not_come_back"),
    ("core/rollout.py", "moved[:, : size - N] += row[:, N:]", "moved[:, : size - N] += 0.0 * row[:, N:]", "core/test_rollout.py::test_every_form_of_the_same_run_agrees"),
    ("core/rollout.py", "start = start[:, ::-1].reshape", "start = start.reshape", "core/test_rollout.py::test_every_form_of_the_same_run_agrees"),
    ("core/rollout.py", "states[:number] = _forced(rows, propagator.state_input)", "states[:number] = 0.5 * _forced(rows, propagator.state_input)", "core/test_fast_paths.py::test_free_runs_are_the_loop_over_the_extended_state"),
    ("core/solve.py", "@ regressors.T - ridge * found", "@ regressors.T", "core/test_solve.py::test_primal_dual_and_svd_agree_where_a_gram_matrix_is_chosen"),
    ("core/solve.py", "kept = min(kept, rank)", "kept = min(kept, rank + 1)", "core/test_fast_paths.py::test_a_rank_is_that_of_the_truncated_matrix"),
    ("core/solve.py", "return bool(ridge >= GRAM_LIMIT * largest[0])", "return True", "core/test_solve.py::test_the_gram_matrix_is_used_from_the_limit_on_and_singular_values_below"),
    ("core/solve.py", "ridge * problem.columns if per_snapshot else ridge", "ridge", "models/test_selection.py::test_a_run_in_which_nothing_moves_weighs_nothing_beside_plain_fits_and_forecasts"),
    ("core/solve.py", "solving[:, group.newest] *= 0.5", "solving[:, group.newest] *= 1.0", "core/test_fast_paths.py::test_every_form_gives_the_papers_formula"),
    ("core/solve.py", "weights = values / (values**2 + ridge)", "weights = values / (values**2 + ridge**2)", "core/test_solve.py::test_primal_dual_and_svd_agree_where_a_gram_matrix_is_chosen"),
    ("core/spectra.py", "both = self.input_power[:, :, None] * self.outputs[:, None]", "both = np.sqrt(self.input_power[:, :, None] * self.outputs[:, None])", "check/test_coherence.py::test_coherence_is_that_of_scipy"),
    ("core/spectra.py", "gain = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True) @ cross", "gain = cross", "check/test_coherence.py::test_the_interval_of_what_is_left_covers_as_it_says"),
    ("core/spectra.py", "left * self.averages / (self.averages - size)", "left", "check/test_coherence.py::test_the_interval_of_what_is_left_covers_as_it_says"),
    ("core/stability.py", "np.hypot(real, imag) > radius", "abs(real) > radius", "core/test_clipping.py::test_the_clipped_channel_has_the_polynomial_with_the_clipped_roots"),
    ("core/stability.py", "wanted, gain = value * radius / abs(value), reach @ direction", "wanted, gain = value * radius, reach @ direction", "core/test_clipping.py::test_the_clipped_channel_has_the_polynomial_with_the_clipped_roots"),
    ("core/subspace.py", "embed(u, input_delays - 1, first - 1, columns)", "embed(u, input_delays - 1, first, columns)", "core/test_subspace.py::test_a_known_system_is_recovered_and_forecast_to_rounding"),
    ("core/two_way.py", "np.arange(block)) % size", "0 * np.arange(block)) % size", "statistics/test_two_way.py::test_neighbours_are_drawn_together"),
    ("core/whiteness.py", "out[: len(found), column] = found", "out[: len(found), column] += 1", "check/test_residuals.py::test_a_right_model_leaves_white_errors"),
    ("models/alignment.py", "speeds.std(ddof=1)", "2**0.5 * speeds.std(ddof=1)", "models/test_alignment.py::test_the_spread_of_celerities_is_that_between_the_runs"),
    ("models/draws.py", "max(settings.window, least) if", "settings.window + reach if", "models/test_contracts.py::test_a_history_inside_the_window_is_not_counted_twice"),
    ("models/engine.py", "<= reach[:, [column]] * excess", "<= reach[:, [column]]", "models/test_stability.py::test_an_answer_to_waves_thirty_times_as_high_is_not_lost"),
    ("models/export.py", "lead - (term.order > 0)", "lead", "hosts/test_mat.py::test_a_mat_file_with_observables_computes_the_forecast"),
    ("models/forecasts.py", '"diverged_at": lost, ', "", "models/test_stability.py::test_a_forecast_that_diverges_ends_in_nan_with_its_status"),
    ("models/labelled.py", "*filter(is_elevation, inputs), *lengths", "*inputs", "models/test_selection.py::test_periods_are_counted_in_the_first_elevation"),
    ("models/live.py", "white = update.whitening @ np.where(", "white = 1.0 * np.where(", "models/test_live.py::test_a_spike_is_forgotten_by_the_consistency"),
    ("models/selection.py", "joined / joined.sum()", "joined / len(folds)", "models/test_selection.py::test_a_run_in_which_nothing_moves_weighs_nothing_beside_plain_fits_and_forecasts"),
    ("models/selection.py", "return self.widest.lead - candidate.lead", "return 0", "models/test_selection.py::test_a_look_ahead_that_the_data_has_is_found"),
    ("models/selection.py", "self.groups[other] != self.groups[run]]", "True]", "test_tuning.py::test_scores_are_those_of_a_plain_loop_of_fits_and_forecasts"),
    ("models/settings.py", "delayed += round(BACK", "delayed += 0 * round(BACK", "models/test_following.py::test_settings_know_the_history_that_carriers_read"),
    ("signals/calculus.py", "(slope / dt if times == 1", "(slope if times == 1", "signals/test_calculus.py::test_a_complementary_rate_keeps_the_steady_drift"),
    ("signals/lags.py", "count = a.size - np.abs(lags)", "count = a.size + 0 * np.abs(lags)", "signals/test_synchronisation.py::test_the_correlation_at_a_lag_is_that_of_the_samples_in_common"),
    ("study/reproduce.py", "HIGH_PASS = 0.15", "HIGH_PASS = 0.25", "study/test_reproduce.py::test_the_edge_of_the_drift_lies_between_drift_and_waves"),
    ("tank/dynamics.py", "+ 4.0 * w / GRAVITY * force", "+ 2.0 * w / GRAVITY * force", "tank/test_dynamics.py::test_wave_drift_damping_is_aranhas"),
    ("tank/instruments.py", "q[1] - settings.eye[0] * q[2]", "q[1] + settings.eye[0] * q[2]", "tank/test_instruments.py::test_a_pitch_that_lifts_the_bow_lifts_the_eye_of_its_line"),
)  # fmt: skip


def run(place: Path, tests: list[str], *options: str) -> subprocess.CompletedProcess[str]:
    """Run tests in a copy of the project."""
    environment = os.environ | {"PYTHONPATH": str(place / "src"), "PYTHONDONTWRITEBYTECODE": ""}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *options]
    command += [f"tests/{test}" for test in tests]
    return subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True)


def verdict(place: Path, file: str, old: str, new: str, tests: str) -> str:
    """What tests say of one change: killed, survives or stale."""
    path = place / "src/seakeep" / file
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    if text.count(old) != 1:
        return "stale"
    path.write_text(text.replace(old, new), encoding="utf-8")
    done = run(place, tests.split(), "-x")
    path.write_text(text, encoding="utf-8")
    return {0: "survives", 1: "killed"}.get(done.returncode, "stale")


def key(change: tuple[str, ...]) -> str:
    """A change, the file that it is made in and its tests, in short."""
    files = [f"src/seakeep/{change[0]}", *(f"tests/{t.split('::')[0]}" for t in change[3].split())]
    texts = [path.read_bytes() for name in files if (path := ROOT / name).exists()]
    return hashlib.sha256(b"\0".join([repr(change).encode(), *texts])).hexdigest()[:16]


def main() -> int:
    """Make the chosen changes and print what survives."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-k", default="", help="words that file, line or tests of a change hold")
    parser.add_argument("-j", "--jobs", type=int, default=1, help="changes at a time")
    parser.add_argument("--results", type=Path, default=ROOT / "build/mutations.txt")
    chosen = parser.parse_args()
    changes = [each for each in CHANGES if all(word in " ".join(each) for word in chosen.k.split())]
    chosen.results.parent.mkdir(exist_ok=True)
    chosen.results.touch()
    lines = chosen.results.read_text(encoding="utf-8").splitlines()
    known = dict(line.split(maxsplit=2)[:2] for line in lines)
    left = [each for each in changes if key(each) not in known]
    places: queue.Queue[Path] = queue.Queue()

    def judge(change: tuple[str, ...]) -> None:
        place = places.get()
        found = verdict(place, *change)
        places.put(place)
        known[key(change)] = found
        with chosen.results.open("a", encoding="utf-8") as file:
            file.write(f"{key(change)} {found} {change[0]}: {change[2]}\n")

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(chosen.jobs) as pool:
        for number in range(chosen.jobs):
            place = Path(folder, str(number))
            without = shutil.ignore_patterns(".*", "__pycache__", "build", "dist")
            shutil.copytree(ROOT, place, ignore=without)
            places.put(place)
        tests = sorted({test for change in left for test in change[3].split()})
        if tests and (done := run(place, tests)).returncode:
            print(done.stdout, "Tests fail without a change.", sep="\n")
            return 1
        for _ in track(pool.map(judge, left), "Wrong changes", len(left)):
            pass
    found = [known[key(each)] for each in changes]
    for each, what in zip(changes, found, strict=True):
        if what != "killed":
            print(f"{what}: {each}")
    print(f"{found.count('killed')} of {len(found)} wrong changes are killed")
    return int(found.count("killed") < len(found))


if __name__ == "__main__":
    sys.exit(main())
