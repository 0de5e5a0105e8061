"""The examples in service: the C estimator on a run, and a thruster that is planned."""

import numpy as np
from compiled import need_compiler
from loaded import loaded
from near import assert_near
from places import ROOT
from records import record, rms
from scipy import signal

import seakeep

EXAMPLES = ROOT / "examples"


def test_the_c_estimator_is_python_where_a_tenth_is_lost(make_run, tmp_path):
    need_compiler()
    example = loaded(EXAMPLES / "in_service/play_c.py")
    model = seakeep.HankelDMDc(4, 8, 1.0).fit(make_run(), ["heave", "pitch"], ["eta_fwd"])
    estimates, ahead, outside, lost = example.play(model, make_run(500, 3), tmp_path)
    assert 20 < lost.sum() < 80
    # The same sums in another order.
    assert_near(estimates[:, 0], estimates[:, 1], 1e-12)
    assert np.isfinite(ahead).all()
    assert outside == 0


PLAN = loaded(EXAMPLES / "known_actuator/plan.py")


def drifting(seed):
    """A surge of 40 s, driven by slow noise, and waves that do little to it."""
    rng, samples = np.random.default_rng(seed), 2000
    slow = signal.lfilter([0.005], [1, -0.995], rng.standard_normal(samples))
    wave = signal.lfilter(*signal.butter(2, [0.08, 0.12], "bandpass"), rng.standard_normal(samples))
    surge, rate, fwd, cog = 1e-4 * rng.standard_normal((4, samples)) + [
        0.01 * wave, 0 * wave, wave, np.roll(wave, 5)
    ]  # fmt: skip
    attrs = {"encounter_period": 2.0}
    run = record(0.1, attrs, surge=surge, surge_rate=rate, eta_fwd=fwd, eta_cog=cog)
    return PLAN.thrusted(run, 0.1 * slow)


def test_a_planned_thrust_holds_a_vessel_nearer_to_its_place():
    model = PLAN.fit({str(seed): drifting(seed) for seed in (1, 2)})
    away = {}
    for plans in (False, True):
        away[plans] = rms(PLAN.play(model, drifting(3), plans) - model.state_scale.centre[0])
    # A plan of another sign or another instant pushes it away.
    assert away[True] < 0.4 * away[False]
