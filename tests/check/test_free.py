"""Modes and decay of systems whose law is known."""

from math import tau

import numpy as np
import pytest
import scipy
from near import assert_near
from numpy.testing import assert_allclose
from oscillators import Oscillator
from records import record
from said import data_error, warned

from seakeep import HankelDMDc, check
from seakeep.check.motion import free_decay
from seakeep.check.parts import samples_in

DT, FREQUENCY, RATIO = 0.05, 2.0, 0.06  # s, rad/s, 1


def fitted(ratio, centre=0):
    spec = HankelDMDc(0, 0, 1e-9, centre=centre)
    return spec.fit(Oscillator(ratio, DT).run(2000), ["heave", "heave_rate"], ["eta_fwd"])


@pytest.fixture(scope="module")
def model():
    return fitted(RATIO)


@pytest.mark.parametrize("ratio", [RATIO, 0.3])
def test_the_decay_of_an_oscillator_is_its_own(ratio):
    """δ = 2πζ/√(1 − ζ²): with ζ = 0.3 a division by 2π alone is 5 % too large."""
    found = check.decay(fitted(ratio, 100 if ratio == RATIO else 0))
    period = tau / (FREQUENCY * np.sqrt(1 - ratio**2))
    # Extremes between samples by a parabola: (ωΔt)²/12 of a step; fewer of them with ζ = 0.3.
    assert_allclose(found.period[0], period, rtol=1e-3)
    alone = free_decay(found.displacement[0].values, DT)
    assert_allclose(found.damping_ratio[0], ratio, rtol=0.01)
    assert_allclose(alone.damping_ratio, ratio, rtol=0.01)
    assert found.displacement[0, 0] == 1.0


def test_swings_of_other_modes_are_no_decay():
    """Heave is released into a mode that dies at once, and leaves 5 % to the oscillator."""
    run = Oscillator(RATIO, DT).run(2000)
    fast = run["heave"].copy(data=scipy.signal.lfilter([0, 1], [1, -0.3], run["eta_fwd"]))
    run = run.assign(heave=fast + 0.1 * run["heave"], pitch=run["heave"] + 0.5 * fast)
    fit = HankelDMDc(0, 0, 1e-9).fit(run, ["heave", "pitch", "heave_rate"], ["eta_fwd"])
    found = check.decay(fit)
    assert np.isnan([found.period[0], found.damping_ratio[0], found.p[0]]).all()
    swings = free_decay(found.displacement[0].values, DT)
    assert swings.damping_ratio == pytest.approx(RATIO, rel=0.01)
    assert found.damping_ratio[1] == pytest.approx(RATIO, rel=0.01)


def test_modes_say_which_states_take_part(model):
    found = check.modes(model)
    assert_allclose(found.damping_ratio[0], RATIO, rtol=1e-4)  # the ridge
    # Heave and its rate hold half of the energy each.
    assert_near(found.participation[0], [0.5, 0.5], 0.01)
    real = check.modes(fitted(2.0))  # overdamped
    slow, fast = FREQUENCY * (2 - 3**0.5), FREQUENCY * (2 + 3**0.5)
    assert_allclose(real.decay_time, [1 / slow, 1 / fast], rtol=1e-4)  # the ridge
    # The eigenvector (1, λ) and the left one, (λ', −1) of the other, give λ' and −λ.
    assert_allclose(real.participation[0].values * (fast + slow), [fast, slow], rtol=1e-4)


def test_quadratic_damping_is_found_from_a_decay(model):
    """A heave released from 1 m, with linear and quadratic damping."""

    def rate(_, s):
        return [s[1], -2 * 0.02 * FREQUENCY * s[1] - 0.3 * abs(s[1]) * s[1] - 4 * s[0]]

    time = DT * np.arange(900)
    made = scipy.integrate.solve_ivp(rate, (0, time[-1]), [1.0, 0.0], t_eval=time, rtol=1e-8)
    found = check.measured_decay(model, {"still": record(DT, {"waves": "still"}, heave=made.y[0])})
    assert found.motion.item() == "heave"
    # Equivalent linearisation: p = 2πζ, q = 8b/3, to second order in the damping, of which large
    # swings, which count most, have more.
    assert_allclose(found.p[0], tau * 0.02, rtol=0.03)
    assert_allclose(found.q[0], 8 / 3 * 0.3, rtol=0.05)


@pytest.mark.parametrize("period", [60.0, 180.0])
def test_a_jerk_at_the_release_is_no_swing(period):
    """As of surge, which the waves of the release shake too."""
    time, rate = np.arange(0, 1200, 0.3), tau / period
    jerk = 0.1 * np.exp(-time / 3) * np.sin(np.pi * time)
    found = free_decay(np.exp(-0.1 * rate * time) * np.cos(rate * time) - jerk, 0.3)
    assert_allclose(found.period, period, rtol=1e-4)  # parabolas on samples
    assert_allclose(found.p, 0.1 * tau, rtol=1e-3)
    assert abs(found.q) < 1e-3  # of a p of 0.63


@pytest.fixture
def released(model):
    """A heave held at 1 m and released after 10 s, and again from 0.2 m; noise of 5 mm."""
    time, rate = DT * np.arange(6000), 0.06 * FREQUENCY
    swing = np.exp(-rate * time) * (np.cos(FREQUENCY * time) + 0.06 * np.sin(FREQUENCY * time))
    heave = np.concatenate([np.ones(200), swing])[:6000]
    heave[4000:] += 0.2 * swing[:2000]
    heave += 0.005 * np.random.default_rng(0).standard_normal(6000)
    run = record(DT, {"waves": "still"}, heave=heave, heave_rate=np.zeros(6000))
    run.heave.attrs["noise_std"] = 0.005
    return run


def test_a_decay_is_the_same_however_long_the_record_goes_on(model, released):
    runs = {f"{end} s": released.sel(time=slice(end)) for end in (60, 150, 300)}
    runs["after the release"] = released.sel(time=slice(9, 60))
    found = check.measured_decay(model, runs)
    # Five repetitions of the noise scatter by 0.2 % and 1 % (one SD).
    assert_allclose(found.period, tau / FREQUENCY, rtol=0.008)
    assert_allclose(found.damping_ratio, 0.06, rtol=0.03)
    assert abs(found.q).max() < 0.03  # of a p of 0.38
    assert len(set(found.cycles.values)) == 1


def test_a_run_in_which_nothing_was_released_is_no_decay(model, released):
    calm = released.sel(time=slice(150, 190))
    with warned("no decay from calm: .*Was anything released"):
        found = check.measured_decay(model, {"calm": calm, "released": released})
    assert found.run.values == ["released"]
    refused = {
        "no run in still water is a free decay": calm,
        r"waves = 'still' and role = 'test' .*unused": released.assign_attrs(waves=""),
    }
    for words, run in refused.items():
        with data_error(words):
            check.measured_decay(model, {"run": run})


def test_a_forecast_starts_where_the_waves_have_come():
    time = np.arange(0, 200, 0.1)
    wave = np.where(time < 40, 0.0, np.sin(np.pi * time))
    run = record(0.1, eta=wave, heave=np.where(time < 50, 0.0, np.sin(np.pi * time + 1)))

    def start(names, span=(0.0, 199.9), history=11, stated=None):
        first, last = samples_in(run, names, span, 0.1, history, 3, stated)
        assert last == 1997  # the last step reads three samples ahead
        return time[first]

    # The waves stand in a window of two periods of 2 s, whose spread is a fifth of theirs.
    assert_near(start(["heave", "eta"]), 50, 1)
    assert_near(start(["eta"]), 40, 1)
    assert start(["eta"], span=(60.0, 199.9)) == 60
    assert start(["eta"], history=701) == 70
    assert start(["eta"], stated=20.0) == 20
