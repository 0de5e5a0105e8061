"""Coherence, and the bound of a linear map, for systems that are known."""

from dataclasses import replace

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose
from records import autoregressive, record
from said import data_error
from scipy import signal

from seakeep import Expression, HankelDMDc, check
from seakeep.check import Checked
from seakeep.core.spectra import cross_spectra
from seakeep.report.check_page import possible_section

RNG = np.random.default_rng


@pytest.fixture(scope="module")
def run():
    """Heave answers the wave and, uncorrelated with it, the wave's square: half of its SD."""
    wave = autoregressive(RNG(0).standard_normal(12000), 0.5)
    wave /= wave.std()
    linear = signal.lfilter([0.0, 1.0, 0.6], [1.0], wave)
    square = np.roll(wave**2 - 1, 1)
    heave = np.sqrt(0.75) * linear / linear.std() + 0.5 * square / square.std()
    return record(0.1, {"encounter_period": 1.0, "waves": "irregular"}, eta=wave, heave=heave)


def said_of(found):
    return possible_section(found, Checked({}, {}, {})).points[0]


def fitted(run, observables=(), ridge=1e-6):
    spec = HankelDMDc(0, 3, ridge, delay_rows="exact", observables=observables)
    return spec.fit(run.isel(time=slice(4000)), ["heave"], ["eta"])


def test_a_state_too_slow_for_the_segments_is_not_judged(run):
    both = run.assign(surge=0.01 * run.heave + np.sin(0.1 * run.time))
    both.surge.attrs["units"] = "m"
    model = HankelDMDc(0, 3, 1e-3).fit(both.isel(time=slice(4000)), ["surge"], ["eta"])
    found = check.coherence(model, {"run": both})
    assert_allclose(found.period[0], 62.8, rtol=0.05)  # a segment has 16 s
    assert np.isnan(found.linear_bound[0])
    assert said_of(found).startswith("surge: cannot be judged: its slow period of 6")


def test_a_channel_that_is_turned_over_is_told_so(run):
    model = fitted(run)
    for turned, said in (
        (run, False),
        (run.assign(heave=(-run.heave).assign_attrs(units="m")), True),
    ):
        found = check.coherence(model, {"run": turned})
        assert abs(found.correlation[0]) > 0.8
        assert ("sign looks turned over" in said_of(found)) == said


def test_observables_lower_the_bound(run):
    """A wave that is Gaussian says nothing linear of its square: 0.5 of the SD is left."""
    square = (Expression("square", "eta**2"),)
    # A baseline that takes the observables too is not linear, and bounds no linear map.
    other = {"damped": fitted(run, square, 1e3)}
    found = check.coherence(fitted(run, square), {"run": run}, None, other)
    assert_near(found.linear_bound[0], 0.5, 0.03)  # 75 x 2 segments
    assert found.observables_bound[0] < 0.15  # a lag of a sample in segments of 160
    assert found.nrmse[0] < 0.01
    assert "observables_bound" not in check.coherence(fitted(run), {"run": run})


def light_run(seed, noise=0.01):
    """Heave is a lightly damped answer to a wave that comes late, with a little noise."""
    rng = RNG(seed)
    wave = signal.lfilter([1.0], [1.0, -1.6, 0.9], rng.standard_normal(6000))
    answer = signal.lfilter([0.0, 0.0, 0.0, 1.0], [1.0, -1.7, 0.98], wave)
    attrs = {"encounter_period": 1.0, "waves": "irregular", "test_span": (0.0, 1e4)}
    return record(0.1, attrs, eta=wave, heave=answer / 160 + noise * rng.standard_normal(6000))


def test_no_linear_model_lies_below_the_bound_of_a_lightly_damped_vessel():
    test = {"run": light_run(6)}
    spec = HankelDMDc(1, 5, 1e-9, delay_rows="exact")
    exact, blurred = (spec.fit(light_run(5, noise=n), ["heave"], ["eta"]) for n in (0, 0.01))
    eta, heave = (test["run"][name].values[:, None] for name in ("eta", "heave"))
    plain = float(np.sqrt(cross_spectra([(eta, heave)], 0.1, 600).share()[0, 0]))
    found = check.coherence(blurred, test)
    assert found.linear_bound[0] < found.nrmse[0]
    assert found.linear_bound[0] < 0.6 * plain  # of the resonance, leakage leaves much
    # Without its observable the model is a linear one.
    cubed = replace(spec, observables=(Expression("cube", "eta**3"),))
    further = check.coherence(cubed.fit(light_run(5, noise=0), ["heave"], ["eta"]), test)
    beside = check.coherence(blurred, test, None, {"a": exact})
    for each in (check.coherence(exact, test), beside, further):
        # The noise; the start of the free run, which has it too, adds some two per cent.
        assert each.linear_bound_lower[0] / 1.02 < 0.01 / heave.std() < each.linear_bound_upper[0]
        assert each.linear_bound[0] <= each.nrmse[0]


def test_the_interval_of_what_is_left_covers_as_it_says():
    rng = RNG(7)
    u = rng.standard_normal((2000, 2))
    noise = signal.lfilter([1.0, 0.6], [1.0], rng.standard_normal((2000, 500)), axis=0)
    found = cross_spectra([(u, u @ [[1.0], [0.5]] + noise)], 1.0, 80)
    power = 1.36 * 2 * (len(found.frequency) - 1)  # of the noise, over one-sided densities
    _, low, high = found.share() * found.outputs.sum(axis=0)
    # 500 repetitions know a coverage of 95 % to 1 % (one SD).
    assert 0.92 <= np.mean((low < power) & (power < high)) <= 0.98


def test_averages_and_the_interval_of_a_gain_are_those_of_repetitions():
    rng = RNG(8)
    u, noise = rng.standard_normal((2000, 1)), rng.standard_normal((2000, 500))
    found = cross_spectra([(u, 2 * u + noise)], 1.0, 80)
    gain, radius = found.gain()
    # 500 repetitions at 39 frequencies know a coverage of 95 % to a third of a per cent.
    assert_near(np.mean(np.abs(gain - 2)[1:-1] < radius[1:-1]), 0.95, 0.01)
    power = cross_spectra([(u, noise)], 1.0, 80).outputs[2:-2]
    # The variance of a mean of n densities is 1/n of their square; 500 know it to 1 %.
    assert_allclose(found.averages, power.mean() ** 2 / power.var(), rtol=0.03)


def test_coherence_is_that_of_scipy():
    rng = RNG(1)
    u = rng.standard_normal((4000, 2))
    x = u @ [[1.0, 0.2], [0.5, -1.0]] + rng.standard_normal((4000, 2))
    found = cross_spectra([(u, x)], 0.5, 200)
    known = signal.coherence(
        u[:, 1] - u[:, 1].mean(), x[:, 0] - x[:, 0].mean(), 2.0, nperseg=200, detrend=False
    )
    assert_allclose(found.frequency, known[0])
    assert_near(found.ordinary()[:, 1, 0], known[1], 1e-12)  # rounding


def test_what_cannot_be_judged_says_why(run):
    model = fitted(run)
    for words, part in (
        (
            r"all runs \(a\) are in regular waves.*coherence takes a",
            run.assign_attrs(waves="regular"),
        ),
        (r"has 9.6 s, and spectra take a segment of 16 s", run.isel(time=slice(100))),
        (r"independent segments, and coherence with 1 input", run.isel(time=slice(200))),
        (
            r"the inputs \(eta\) hold no energy",
            run.assign(eta=(0 * run.eta).assign_attrs(units="m")),
        ),
    ):
        with data_error(words):
            check.coherence(model, {"a": part})
