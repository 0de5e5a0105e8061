"""The alignment on the virtual tank: celerities against the true sea, and what it brings."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import seakeep
from seakeep.signals import effective_celerity, peak_period, phase_celerity
from seakeep.tank.play import play_run
from seakeep.waves import phase_speed

pytest.importorskip("numba")
SCRIPT = Path(__file__).parents[2] / "benchmarks" / "alignment_on_tank.py"


@pytest.fixture(scope="module")
def script():
    found = importlib.util.spec_from_file_location("alignment_on_tank", SCRIPT)
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def sampled(script):
    return script.irregular_runs()


def test_celerities_are_those_of_the_sea_that_was_played(sampled, settings, rig):
    period, runs = sampled
    assert period == pytest.approx(1.64, abs=0.05)  # the paper's
    for name, run in runs.items():
        upstream, downstream = run["eta_kn_fwd"].values, run["eta_kn_cog"].values
        depth, apart = run.attrs["water_depth"], 52.09 - 48.42
        found = effective_celerity(upstream, downstream, run.attrs["dt"], apart, depth)
        sea = play_run(settings, name, rig).sea
        lags = np.linspace(*found.bounds, 4001)
        power = sea.amplitude**2
        truth = (power * np.cos(np.outer(lags, sea.omega) - sea.wavenumber * apart)).sum(axis=1)
        # Asked for: 3 %. Found: 0.8 % at most.
        assert found.celerity == pytest.approx(apart / lags[np.argmax(truth)], rel=0.03)
        peak = 1 / peak_period(upstream, run.attrs["dt"])
        phase = phase_celerity(upstream, downstream, run.attrs["dt"], apart, depth)
        assert phase.at(peak) == pytest.approx(
            float(phase_speed(2 * np.pi * peak, depth)), rel=0.03
        )


@pytest.mark.filterwarnings("ignore::seakeep.SeakeepWarning")
def test_alignment_with_measured_surge_lowers_the_error_of_unseen_windows(script, sampled):
    period, runs = sampled
    errors = {
        name: script.window_errors(runs, period, "paper", script.ALIGNMENTS[name], ["irregular_3"])
        for name in ("measured, effective", "none")
    }
    aligned, none = (each.mean(axis=1) for each in errors.values())
    middle, _, high = script.paired(aligned, none, np.random.default_rng(0))
    # Over all three runs: −0.21 with an interval of −0.23 to −0.18 (the script's table).
    assert middle < -0.1
    assert high < 0
    medians = dict(
        zip(script.STATES, np.median(errors["measured, effective"], axis=0), strict=True)
    )
    assert medians["heave"] <= 0.4
    assert medians["pitch"] <= 0.4


def test_the_paper_s_halves_repeat_and_other_runs_do_not(sampled):
    _, runs = sampled
    first, second, third = (run["eta_kn_fwd"].values for run in runs.values())
    dt = next(iter(runs.values())).attrs["dt"]
    half = first.size // 2
    found = seakeep.signals.find_repeat([first[:half]], first[half:], dt)
    assert found is not None
    assert found.correlation > 0.99
    later = half * dt + found.test_start - found.training_start
    assert later == pytest.approx(99 / 0.85, abs=dt)
    assert seakeep.signals.find_repeat([second, third], first, dt) is None
