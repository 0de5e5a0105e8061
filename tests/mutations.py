"""Wrong one-line changes, and the test that fails on each: `python tests/mutations.py [WORD]`.

Not collected by pytest. Each change is applied to a copy of the sources; a change whose test still
passes is a survivor, and the command ends with status 1. WORD picks the changes whose file, line or
test hold it.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PARTS = ("src", "tests", "conftest.py", "pyproject.toml", "README.md")
MUTATIONS = (
    # file below src/seakeep, old line, new line, test below tests
    ("core/two_way.py", "np.arange(block)) % size", "0 * np.arange(block)) % size",
     "statistics/test_two_way.py::test_neighbours_are_drawn_together"),
    ("core/calibration.py", "total += 2.0 * correlation", "total += correlation",
     "statistics/test_calibration.py::test_the_block_is_the_integrated_correlation_time"),
    ("core/metrics.py", "NOISE_FACTOR = 2**0.5", "NOISE_FACTOR = 2.0",
     "test_metrics.py::test_a_channel_is_judged_where_less_than_half_of_its_variance_is_noise"),
    ("core/metrics.py", "load <= noise_std", "load <= 2 * noise_std",
     "tank/test_quality_on_tank.py"),
    ("core/harmonics.py", "part.std(axis=-2, ddof=1)", "part.std(axis=-2, ddof=0)",
     "check/test_response.py::test_type_a_uncertainty_is_that_of_the_mean_of_few_windows"),
    ("core/extremes.py", "p / np.hypot(2 * np.pi, p)", "p / (2 * np.pi)",
     "check/test_free.py::test_strong_damping_is_no_small_angle"),
    ("check/free.py", "linear / np.hypot(2 * np.pi, linear)", "linear / (2 * np.pi)",
     "check/test_free.py::test_the_decay_of_an_oscillator_is_its_own"),
    ("check/residuals.py", "1.96 / np.sqrt(count)", "1.96 / np.sqrt(count - lags)",
     "check/test_residuals.py::test_limits_and_past_inputs_are_those_of_the_errors_by_hand"),
    ("check/residuals.py", "inputs = channel_matrix(run, model.inputs, name, after)",
     "inputs = channel_matrix(run, model.inputs, name, slice(first, last))",
     "check/test_residuals.py::test_limits_and_past_inputs_are_those_of_the_errors_by_hand"),
    ("signals/lags.py", "count = a.size - np.abs(lags)", "count = a.size + 0 * np.abs(lags)",
     "signals/test_synchronisation.py::test_the_correlation_at_a_lag_is_that_of_the_samples_in_common"),
    ("signals/calculus.py", "(slope / dt if times == 1", "(slope if times == 1",
     "signals/test_calculus.py::test_a_complementary_rate_keeps_the_steady_drift"),
    ("models/alignment.py", "speeds.std(ddof=1)", "2**0.5 * speeds.std(ddof=1)",
     "models/test_alignment.py::test_the_spread_of_celerities_is_that_between_the_runs"),
    ("models/draws.py", "max(settings.window, least) if", "settings.window + reach if",
     "models/test_contracts.py::test_a_history_inside_the_window_is_not_counted_twice"),
    ("study/reproduce.py", "HIGH_PASS = 0.15", "HIGH_PASS = 0.25",
     "study/test_reproduce.py::test_the_edge_of_the_drift_lies_between_drift_and_waves"),
    ("tank/dynamics.py", "+ 4.0 * w / GRAVITY * force", "+ 2.0 * w / GRAVITY * force",
     "tank/test_dynamics.py::test_wave_drift_damping_is_aranhas"),
    ("tank/instruments.py", "q[1] - settings.eye[0] * q[2]", "q[1] + settings.eye[0] * q[2]",
     "tank/test_instruments.py::test_a_pitch_that_lifts_the_bow_lifts_the_eye_of_its_line"),
    ("core/kalman.py", "block = top @ self.a.T + self.process", "block = top @ self.a.T",
     "core/test_kalman.py"),
    ("models/live.py", "white = update.whitening @ np.where(", "white = 1.0 * np.where(",
     "models/test_live.py"),
    ("models/selection.py", "joined / joined.sum()", "joined / len(folds)",
     "models/test_selection.py"),
    ("models/settings.py", "delayed += round(BACK", "delayed += 0 * round(BACK",
     "models/test_following.py::test_settings_know_the_history_that_carriers_read"),
    ("models/export.py", "lead - (term.order > 0)", "lead", "hosts/test_mat.py"),
    ("models/labelled.py", "*filter(is_elevation, inputs), *lengths", "*inputs",
     "models/test_selection.py"),
    ("models/selection.py", "return self.widest.lead - candidate.lead", "return 0",
     "models/test_selection.py::test_a_look_ahead_that_the_data_has_is_found"),
    ("models/selection.py", "self.groups[other] != self.groups[run]]", "True]",
     "test_tuning.py::test_scores_are_those_of_a_plain_loop_of_fits_and_forecasts"),
    ("models/engine.py", "<= reach[:, [column]] * excess", "<= reach[:, [column]]",
     "models/test_stability.py"),
    ("models/forecasts.py", '"diverged_at": lost, ', "",
     "models/test_stability.py"),
    ("core/bootstrap.py", "special.stdtrit(blocks - 1.0, 0.5 + level / 2)", "1.96",
     "statistics/test_two_way.py"),
    ("core/spectra.py", "out[: len(found), column] = found", "out[: len(found), column] += 1",
     "check/test_residuals.py"),
)  # fmt: skip


def survives(place: Path, file: str, old: str, new: str, test: str) -> bool:
    """Whether a test passes with a line changed in a copy of the project."""
    path = place / "src" / "seakeep" / file
    text = path.read_text(encoding="utf-8")
    if text.count(old) != 1:
        raise SystemExit(f"{file} holds {old!r} {text.count(old)} times: correct the table.")
    path.write_text(text.replace(old, new), encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(place / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    try:
        done = subprocess.run(
            [*command, f"tests/{test}"], cwd=place, env=environment, capture_output=True, text=True
        )
    finally:
        path.write_text(text, encoding="utf-8")
    if done.returncode not in (0, 1):
        raise SystemExit(f"{test} cannot run:\n{done.stdout}{done.stderr}")
    return done.returncode == 0


def main(words: list[str]) -> int:
    chosen = [each for each in MUTATIONS if all(word in " ".join(each) for word in words)]
    survivors = 0
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for part in PARTS:
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy2
            copy(ROOT / part, place / part)
        for each in chosen:
            alive = survives(place, *each)
            survivors += alive
            print(f"{'SURVIVES' if alive else 'killed'}  {each[0]}: {each[2]}  ({each[3]})")
    print(f"{len(chosen) - survivors} of {len(chosen)} wrong changes are killed")
    return int(survivors > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
