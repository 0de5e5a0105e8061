"""Departures from the means of each run: offsets per run change a forecast by themselves only."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from drifting import INPUTS, STATES, drifting_run
from near import assert_near
from records import arrays_at, record, table
from said import request_error

from seakeep import BayesianHankelDMDc, HankelDMDc, Powers, SlowSquares, Uniform, load_model
from seakeep.baselines import ARX, Subspace
from seakeep.hosts.program import exportable

DT, PERIOD = 0.1, 240
A = np.array([[1.6, 0.1], [0.05, 0.7]]), np.array([[-0.9, 0.0], [0.0, 0.1]])
B = np.array([[0.3, 0.02], [0.1, -0.05]])
OFFSETS = {"heave": 3.0, "pitch": -0.4, "eta": 0.2, "wind": 8.0}
SPEC = HankelDMDc(1, 0, 0.0, delay_rows="exact", centre="run")


def vessel(seed, offset=0.0):
    """Two states in a steady answer to two inputs of period `PERIOD`, on zeros of their own."""
    inputs = np.fft.rfft(np.random.default_rng(seed).standard_normal((PERIOD, 2)), axis=0)
    inputs[0] = inputs[40:] = 0.0
    z = np.exp(2j * np.pi * np.arange(len(inputs)) / PERIOD)[:, None, None]
    system = z * np.eye(2) - A[0] - A[1] / z
    states = np.linalg.solve(system, (inputs @ B.T)[..., None])[..., 0]
    values = np.fft.irfft(np.concatenate([states, inputs], axis=1), PERIOD, axis=0)
    values = np.resize(values, (5 * PERIOD, 4)) + offset * np.array([*OFFSETS.values()])
    attrs = {"encounter_period": PERIOD * DT / 30}
    return record(DT, attrs, **dict(zip(OFFSETS, values.T, strict=True)))


def runs_of(*offsets):
    return {f"run{n}": vessel(n, each) for n, each in enumerate(offsets)}


CHANNELS = ["heave", "pitch"], ["eta", "wind"]


def test_the_system_is_recovered_from_runs_whose_zeros_differ():
    model = SPEC.fit(runs_of(0.0, 1.0, -3.0), *CHANNELS)
    assert model.settings.centre == PERIOD
    scale = model.state_scale.std
    a = model.A[:2] * scale[:, None] / np.tile(scale, 2)
    # Exact data, through a Gram matrix.
    assert_near(a, np.hstack(A), 1e-6)
    run, start = vessel(9, 50.0), DT * (PERIOD + 20)
    found, at = table(model.forecast(run, start, 400), CHANNELS[0]), PERIOD + 21
    assert_near(found, table(run, CHANNELS[0])[at : at + 400], 1e-6)
    assert_near(model.forecast_arrays(*arrays_at(model, run, start), 400), found, 1e-9)


@pytest.mark.parametrize(
    "spec",
    [
        replace(SPEC, ridge=1e-3, state_delays=5, input_delays=9, lead=2),
        replace(SPEC, ridge=1e-3, observables=[SlowSquares("eta", period=0.8)]),
        replace(SPEC, ridge="rollout", ridge_scale="per_snapshot", select={"horizon": (10,)}),
        ARX(3, 4, 1e-3, centre="run"),
        Subspace(4, 4, order=4, future=5, centre="run"),
        BayesianHankelDMDc(2, Uniform(2, 6), 1e-3, window=500, n_members=3, delay_rows="exact",
                           centre="run", centred=True),
    ],
)  # fmt: skip
def test_a_zero_moves_the_forecast_and_changes_nothing_else(spec):
    def moved(run, offset):
        """Squares are of the elevation, whose zero stays."""
        names = [name for name in OFFSETS if name != "eta"]
        return run.assign({name: run[name] + offset * OFFSETS[name] for name in names})

    # Not over whole periods, so that means do not vanish.
    plain = {name: run.isel(time=slice(1100)) for name, run in runs_of(0, 0, 0).items()}
    there = {name: moved(run, n - 0.5) for n, (name, run) in enumerate(plain.items())}
    models = [spec.fit(runs, *CHANNELS) for runs in (plain, there)]
    start = DT * (PERIOD + 100)
    for known in (None, PERIOD + 110):  # samples of inputs that are not predicted
        run = vessel(9).isel(time=slice(known))
        pairs = zip(models, (run, moved(run, 20.0)), strict=True)
        one, other = (
            model.forecast_summary(each, start, 100, ahead="predict").sel(statistic="mean")
            if spec.is_ensemble
            else model.forecast(each, start, 100, ahead="predict")
            for model, each in pairs
        )
        # Differences of numbers of a hundred, through regressions of condition 1e4.
        assert_near(table(other, CHANNELS[0]) - table(one, CHANNELS[0]), [[60.0, -8.0]] * 100, 1e-7)
    first, second = (getattr(model, "selection", "") for model in models)
    assert first == second


def test_regressors_depart_from_their_means_over_the_reference_period():
    observables = [SlowSquares("eta", period=0.8), Powers("wind", (2,))]
    spec, run = replace(SPEC, ridge=1e-3, observables=observables), vessel(3, 1.0)
    runs = {"run": run}
    centred, pooled = (replace(spec, centre=c).fit(runs, *CHANNELS) for c in ("run", "pooled"))
    own, other = (each.read_windows(run, [40.0], 50) for each in (centred, pooled))
    before = pooled.read_windows(run, [40.0 - DT * (PERIOD - 1)], PERIOD)
    # Sums of a few hundred numbers, in another order.
    for name in ("delayed", "direct"):
        mean = getattr(before, name)[:, -PERIOD:].mean(axis=1, keepdims=True)
        assert_near(getattr(own, name)[:, -50:], getattr(other, name)[:, -50:] - mean, 1e-12)


def test_a_surge_that_is_followed_stays_as_it_is(tmp_path):
    moves = {"heave": 1.0, "mooring_bow": 10.0, "wind": 8.0}
    spec = HankelDMDc(
        10, 30, 1e-4, delay_rows="exact", ridge_scale="per_snapshot", lead=12, centre="run",
        alignment={"mode": "dispersion", "surge": "predicted"},
        observables=[SlowSquares("eta_cog", period=1.5, lead=0.75, cutoff=1.0)],
        readouts="auto",
    )  # fmt: skip
    states, inputs = [*STATES, "mooring_bow"], [*INPUTS, "wind"]

    def moved(seed, by):
        """Waves past the probes, in gusts that drive the heave; zeros of three sensors differ."""
        run, rng = drifting_run(seed), np.random.default_rng(seed)
        gusts = np.convolve(rng.standard_normal(run.time.size + 19), np.ones(20) / 20, "valid")
        run["wind"] = ("time", gusts, {"units": "m/s"})
        run["heave"].values[1:] += 0.05 * gusts[:-1]
        for name, each in moves.items():
            run[name].values[:] += by * each
        return run

    plain, there = ([moved(n, n * by) for n in (1, 2, 3)] for by in (0.0, 1.0))
    first, second = (spec.fit(runs, states, inputs) for runs in (plain, there))
    run = moved(4, 0.0)
    before, after = first.forecast(run, 80.0, 200), second.forecast(moved(4, 5.0), 80.0, 200)
    change = table(after - before, states) - [5.0 * moves.get(name, 0.0) for name in states]
    assert_near(change, 0.0, 1e-7)  # loads of 30 N, by ridge regressions
    pooled = replace(spec, centre="pooled").fit(plain, states, inputs)
    assert first.read_windows(run, [80.0], 1).zero[0, 0] == 0.0
    assert first.state_mean[0] == pooled.state_mean[0]
    assert first.signature.direct_scale.mean[-1] == pooled.signature.direct_scale.mean[-1]
    assert before.attrs["status"] == "ok"
    # Runs that are held out depart as those that teach, so that the line is found.
    assert [each.kind for each in first.signature.readouts] == ["wave"]
    again = load_model(first.save(tmp_path / "model.nc"))
    xr.testing.assert_identical(again.forecast(run, 80.0, 200), before)


def test_words():
    model = SPEC.fit(runs_of(0.0, 1.0), *CHANNELS)
    run = vessel(9)
    for refused in (model.live, model.to_state_space, lambda: exportable(model)):
        with request_error(r"\(centre = 'run'\), which forecast"):
            refused()
    with request_error("the model needs 241"):
        model.forecast(run, start=20.0, steps=10)
    assert "means of 240 samples up to a start" in model.summary()
    assert SPEC.resolved(DT, PERIOD * DT / 30).needs(DT).history + 1 == model.history_samples
    assert HankelDMDc(1, 0, 1.0, centre="pooled").centre == 0
    with request_error("centre: "):
        HankelDMDc(1, 0, 1.0, centre="runs")
