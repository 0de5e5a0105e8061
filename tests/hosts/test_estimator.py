"""The estimator in C is the live model of Python, sample by sample."""

import ctypes
import subprocess
from dataclasses import replace

import compiled
import numpy as np
import pytest
from compiled import pointer
from near import assert_near
from numpy.testing import assert_allclose
from records import table

from seakeep import HankelDMDc
from seakeep.hosts import write_estimator
from seakeep.models.growth import LeadErrors
from seakeep.models.validity import Validity
from seakeep.signals.prediction import foresee

STATES, INPUTS = ["heave", "pitch"], ["eta_fwd", "eta_cog"]
COUNT = 700
ROLES = {"eta_cog": "constant"}


@pytest.fixture(scope="module")
def model(make_run):
    return HankelDMDc(6, 9, 1.0).fit([make_run(1200, seed) for seed in (1, 2)], STATES, INPUTS)


@pytest.fixture(scope="module")
def sources(model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("estimators")
    write_estimator(model, folder, "exact")
    return folder


@pytest.fixture(scope="module")
def library(sources):
    return compiled.library(sources)


@pytest.fixture
def exact(library, model):
    """Estimators in C and in Python."""
    return Estimator(library, "exact"), model.live()


def built(model, folder, **settings):
    """Library of an estimator named rom."""
    write_estimator(model, folder, "rom", **settings)
    return compiled.library(folder)


class Estimator:
    """The functions of an estimator, on memory of its own."""

    def __init__(self, library, name, count=2):
        self.count = count
        self.memory = (ctypes.c_double * 200_000)()  # more than the struct
        self.calls = {
            verb: getattr(library, f"{name}_{verb}")
            for verb in ("estimate", "estimated", "deviation", "forecast", "validity")
        }
        self.calls["estimated"].restype = ctypes.POINTER(ctypes.c_double)
        self.calls["deviation"].restype = ctypes.c_double

    def step(self, u, y):
        return self.calls["estimate"](self.memory, pointer(u), pointer(y))

    @property
    def state(self):
        return np.array(self.calls["estimated"](self.memory)[: self.count])

    def beside(self, live, u, y):
        """Estimates after a sample, in C and in Python."""
        assert self.step(u, y) == 0
        return self.state, live.step(u, y)

    def follow(self, live, u, y):
        """Step both through samples, with the same estimates."""
        for sample in zip(u, y, strict=True):
            assert_near(*self.beside(live, *sample), 1e-9)

    @property
    def validity(self):
        return self.calls["validity"](self.memory)

    @property
    def deviations(self):
        return np.array([self.calls["deviation"](self.memory, each) for each in (0, 1)])

    def forecast(self, steps, future=None):
        mean, std = out = np.empty((2, steps, self.count))
        known = None if future is None else pointer(future)
        return self.calls["forecast"](self.memory, steps, known, pointer(mean), pointer(std)), out


def beside_a_constant(model, folder):
    """Estimators in C and in Python, of a wave beside an input that is none."""
    return Estimator(built(model, folder, roles=ROLES), "rom"), model.live(roles=ROLES)


def moments(forecast, states):
    """Mean and standard deviation of a forecast in Python, shape (2, steps, N)."""
    return table(forecast, states)[:2]


def values(run, model):
    """Inputs and states."""
    every = run.to_dataframe()
    return [every[names].to_numpy(copy=True) for names in (model.inputs, model.states)]


def measured(run, model):
    """Inputs and states, of which some are lost: at random, a dead sensor, all for long."""
    u, y = values(run, model)
    lost = np.random.default_rng(4).uniform(size=y.shape) < 0.05
    lost[210:230] = False  # what follows is blind
    lost[:100], lost[150:200, 0], lost[230:310] = True, True, True
    y[lost] = np.nan
    u[[30, 160, 161, 162], 1:] = np.nan
    u[[*range(268, 280), *range(302, 310), *range(315, 320)]] = np.nan
    return u, y


@pytest.mark.usefixtures("errors_of_training")
@pytest.mark.parametrize("side", [-9.0, 9.0])
def test_far_from_the_mean_of_training_a_forecast_lasts_as_in_the_live_model(
    model, make_run, tmp_path, side
):
    scale = model.state_scale
    doubted = replace(model, selection="a copy, whose errors are its own")
    rms = np.full((9, 2), 1.5) * scale.spread  # above those of the mean in seas of training
    vars(doubted)["errors"] = LeadErrors(model.errors.residual, rms)
    live, found = doubted.live(), Estimator(built(doubted, tmp_path), "rom")
    u, y = values(make_run(100, 5), model)
    y[:, 0] += side * scale.spread[0]
    found.follow(live, u, y)
    forecast = found.forecast(60)[1][0]
    assert_allclose(forecast, moments(live.forecast(60), STATES)[0], rtol=1e-9, atol=1e-9)
    far = (forecast - scale.centre) / scale.spread
    assert abs(far[3, 0]) > 3.0
    assert_near(far[-1], 0.0, 1e-12)
    assert_near(far[1:, 1], 0.0, 1e-12)  # the first step is driven by waves as measured


@pytest.mark.usefixtures("errors_of_training")
def test_what_jumps_is_lost_as_in_the_live_model(exact, model, make_run):
    found, live = exact
    (u, y), jumped = values(make_run(COUNT, 5), model), []
    far = 1e3 * y.std(axis=0)
    y[15], y[420], y[500:503] = y[15] + far, y[420] + far, y[500:503] + far
    u[600, 0] += 1e3
    for at in range(COUNT):
        assert_near(*found.beside(live, u[at], y[at]), 1e-9)
        jumped += [(at, each) for each in live.jumped]
        if at in (419, 420, 435, 436, 502, 600):
            assert found.validity & (Validity.CONSISTENCY | Validity.LOST) == live.validity
    assert (420, STATES[0]) in jumped
    assert {at for at, _ in jumped} >= {420, 500, 501, 502, 600}


@pytest.mark.usefixtures("errors_of_training")
def test_a_plan_of_a_known_input_is_followed_beside_a_wave_that_is_predicted(
    model, make_run, tmp_path
):
    found, live = beside_a_constant(model, tmp_path)
    u, y = measured(make_run(COUNT, 5), model)
    found.follow(live, u[:325], y[:325])  # u[315:320] is lost
    plan = np.full((29, 2), np.nan)
    plan[3:, 1] = np.linspace(0, 1, 26)
    expected = moments(live.forecast(30, {"eta_cog": plan[:, 1]}), STATES)
    assert_allclose(found.forecast(30, plan)[1], expected, rtol=1e-7, atol=1e-9)


def test_of_an_input_that_is_no_wave_the_mean_alone_is_judged(exact, model, make_run, tmp_path):
    constant = beside_a_constant(model, tmp_path)
    u, y = values(make_run(300, 5), model)
    for (found, live), outside in ((exact, Validity.HEIGHT | Validity.STEEPNESS), (constant, 0)):
        found.follow(live, u * [1, 3], y)
        assert found.validity == live.conditions.validity == outside
        found.follow(live, np.add(u, [0, 30]), y)
        assert found.validity & live.conditions.validity & Validity.MEAN


def test_a_mean_is_judged_over_two_periods_or_more(exact, model, make_run):
    found, live = exact
    u, y = values(make_run(8 * live.equations["gap"] + 1, 5), model)
    u += [0, 30]
    found.follow(live, u[:-1], y[:-1])
    assert not (found.validity | live.conditions.validity) & Validity.MEAN
    found.beside(live, u[-1], y[-1])
    assert found.validity & live.conditions.validity & Validity.MEAN


def tone():
    """24 periods in 117 samples: four are 19.5 samples, which rounding may take to 19 or 20."""
    noise = np.random.default_rng(0).standard_normal(117)
    return np.cos(2 * np.pi * 24 / 117 * np.arange(117)) + 0.1 * noise


@pytest.mark.parametrize("record", [np.full(8, 0.25), tone()])  # of 0.25 no rounding hides 0/0
def test_a_record_that_stands_still_or_whose_order_is_half_is_predicted_to(exact, record):
    found, live = exact
    for at, wave in enumerate(np.append(record, np.full(4, np.nan))):
        found.beside(live, np.full(2, wave), np.full(2, 0.1 * at))
    # Which reads what was predicted.
    assert_near(*found.beside(live, np.zeros(2), np.full(2, np.nan)), 1e-12)


def test_a_bad_sample_leaves_the_estimator_as_it_was(library):
    found = Estimator(library, "exact")
    for _ in range(3):
        found.step([0.1, 0.2], [0.3, 0.4])
    before = bytes(found.memory)
    for u, y in (
        ([0.1, np.inf], [0.3, 0.4]),
        ([0.1, 0.2], [-np.inf, 0.4]),
        ([np.nan, 0.2], [0, 0]),
    ):
        assert found.step(u, np.array(y, dtype=float)) == 1
    assert bytes(found.memory) == before


def test_it_runs_clean_under_sanitizers_without_a_heap(sources, library, model, make_run):
    try_out = ["cc", "-fsanitize=address,undefined", "-xc", "-o", "/dev/null", "-"]
    if subprocess.run(try_out, input=b"int main(void){return 0;}", capture_output=True).returncode:
        pytest.skip("the compiler has no sanitizers")
    program = """
    #include "exact_estimator.h"
    #include <math.h>
    #include <stdio.h>
    int main(void)
    {
        static exact_estimator e;
        static double x[40 * 2], std[40 * 2];
        double row[4];
        while (fread(row, sizeof row, 1, stdin) == 1)
            if (exact_estimate(&e, row, row + 2))
                return 3;
        if (exact_forecast(&e, 40, NULL, x, std))
            return 4;
        printf("%.12g", x[0]);
        return 0;
    }
    """
    (sources / "main.c").write_text(program)
    u, y = measured(make_run(COUNT, 5), model)
    clean = ["-std=c99", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    files = ["main.c", "exact.c", "exact_estimator.c"]
    subprocess.run(["cc", *clean, "-o", "main", *files, "-lm"], cwd=sources, check=True)
    (sources / "main.c").unlink()
    done = subprocess.run([sources / "main"], input=np.hstack([u, y]).tobytes(), check=True,
                          capture_output=True)  # fmt: skip
    assert np.isfinite(float(done.stdout))
    assert "alloc" not in (sources / "exact_estimator.c").read_text()


def test_what_lies_outside_the_training_is_that_of_the_live_model(cases, tmp_path):
    case = cases["following"]
    model, library = case.model, built(case.model, tmp_path)
    still = (1, False, 0, 0)
    for factor, slow, away, zero in (
        *(still, (2.5, False, 0, 0), (1, True, 0, 0)),
        *((1, False, 9, 0), (1, False, 0, -9), (1, False, 0, 9)),
    ):
        found, live = Estimator(library, "rom", 3), model.live()
        u, y = values(case.run, model)
        u += zero
        y[:, model.states.index("surge")] += away
        if slow:  # a swell of 0.24 Hz
            u[:] = 0.02 * np.sin(0.15 * np.arange(len(u)))[:, None]
        found.follow(live, factor * u[:300], y[:300])
        validity = live.conditions.validity
        assert found.validity == validity
        assert bool(validity) == ((factor, slow, away, zero) != still)
        assert (Validity.MEAN in validity) == bool(zero)


@pytest.mark.usefixtures("errors_of_training")
@pytest.mark.parametrize(
    ("name", "noise"),
    {"full": 1e-5, "short": 1e-5, "autonomous": 0.0, "following": 1e-5,
     "following_now": 0.0}.items(),
)  # fmt: skip
def test_every_model_that_is_exported_is_followed(cases, name, noise, tmp_path):
    """Look-ahead, observables, carried waves and read-outs, with samples lost."""
    model = cases[name].model
    u, y = measured(cases[name].run, model)
    size = np.nanmax(np.abs(y), axis=0)  # a load has other units
    noises = {model.states[-1]: noise * size[-1]} if noise else {}
    library = built(model, tmp_path, noise=noises)
    found, live = Estimator(library, "rom", len(model.states)), model.live(noise=noises)
    if "following" in name:  # from probe to probe for the look-ahead, and on from each record

        def foreseen(known, count):
            first = live._expected(known, max(model.lead_samples, 1))
            more = foresee(np.concatenate([known, first]), count, dt=1, positions=nowhere, depth=1)
            return more._replace(expected=np.concatenate([first, more.expected])[:count])

        nowhere, live._foreseen = [np.nan] * len(model.inputs), foreseen
    # The same sums in another order, through gains of the order of ten.
    close = 1e-10 if "following" in name else 1e-12
    for at in range(340):
        estimates = np.array(found.beside(live, u[at], y[at])) / size
        assert_near(*estimates, close)
        if at == 5:
            assert (found.forecast(20)[0] == 1) == bool(model.inputs)  # no sample so far
        if at > 20:
            expected = np.sqrt(np.maximum(np.diagonal(live.covariance)[:2], 0.0))
            few = size[:2]
            assert_allclose(found.deviations / few, expected / few, rtol=1e-6, atol=close)
        if at in (95, 148, 190, 290, 309, 317, 339):
            assert found.validity & Validity.LOST == live.validity & Validity.LOST
            ways = [(120, None)]  # whose mean tends to that of training
            if model.inputs:
                given = live._known_inputs()[-40:]  # of 40 samples before
                part, first = given.copy(), given.copy()
                part[15:, 0], first[15:] = np.nan, np.nan
                ways += [(20, known) for known in (given, part, first)]
            for steps, known in ways:
                status, forecast = found.forecast(steps, known)
                assert status == 0
                expected = moments(live.forecast(steps, known), model.states)
                # Small differences of runs.
                assert_allclose(forecast / size, expected / size, rtol=1e-6, atol=100 * close)
