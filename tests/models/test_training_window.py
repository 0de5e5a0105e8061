"""Which samples train a model, and what is taken from them."""

import numpy as np
import pytest

from seakeep import HankelDMDc, SeakeepWarning

DT = 0.05


def columns(model):
    return model.training.columns


def test_all_of_a_run_trains_when_no_window_is_set(run, channels):
    model = HankelDMDc(3, 8, 1.0).fit(run, **channels)
    assert columns(model) == (400 - 8 - 1,)
    assert model.training.first == (0.0,)
    assert model.training.stop == (float(run.time[-1]),)


@pytest.mark.parametrize(
    ("history", "samples", "expected"),
    [("before", 800, 639), ("before", 740, 579), ("before", 640, 479), ("inside", 800, 479)],
)
def test_the_papers_window_has_its_columns_where_the_history_fits(
    make_run, channels, history, samples, expected
):
    spec = HankelDMDc(32, 160, 100.0, window=640, history=history)
    model = spec.fit(make_run(samples=samples), **channels)
    assert columns(model) == (expected,)
    assert f"{expected} snapshot pairs" in model.summary()
    assert f"{expected} pairs" in model.summary()


def test_the_window_ends_at_the_stop_and_includes_it(run, channels):
    model = HankelDMDc(3, 8, 1.0, window=100).fit(run, stop=10.0, **channels)
    cut = run.isel(time=slice(0, 201))
    same = HankelDMDc(3, 8, 1.0, window=100).fit(cut, **channels)
    assert (model.training.first[0], model.training.stop[0]) == pytest.approx((5.05, 10.0))
    np.testing.assert_array_equal(model.A, same.A)
    np.testing.assert_array_equal(model.state_mean, same.state_mean)


def test_a_stop_between_two_samples_takes_the_one_before(run, channels):
    for lead in (0, 2):
        spec = HankelDMDc(3, 8, 1.0, window=100, lead=lead)
        model = spec.fit(run, stop=10.0 + 0.7 * DT, **channels)
        same = spec.fit(run, stop=10.0, **channels)
        assert model.training.stop == same.training.stop == pytest.approx((10.0,))
        np.testing.assert_array_equal(model.coefficients, same.coefficients)


@pytest.mark.parametrize("history", ["before", "inside"])
def test_moments_are_those_of_the_windows_pooled_with_ddof_one(make_run, channels, history):
    runs = [make_run(seed=1), make_run(samples=300, seed=2)]
    model = HankelDMDc(3, 8, 1.0, window=120, history=history).fit(runs, **channels)
    for names, mean, std in (
        (channels["states"], model.state_mean, model.state_std),
        (channels["inputs"], model.input_mean, model.input_std),
    ):
        pooled = np.concatenate(
            [np.stack([run[name].values[-120:] for name in names], axis=1) for run in runs]
        )
        # The same sums in the same order, or nearly.
        np.testing.assert_allclose(mean, pooled.mean(axis=0), rtol=1e-13)
        np.testing.assert_allclose(std, pooled.std(axis=0, ddof=1), rtol=1e-13)


def test_without_standardisation_channels_are_taken_as_they_are(run, channels):
    model = HankelDMDc(3, 8, 1.0, standardize=False).fit(run, **channels)
    np.testing.assert_array_equal(model.state_mean, 0.0)
    np.testing.assert_array_equal(model.input_std, 1.0)


@pytest.mark.parametrize("count", [1, 2])
def test_ridge_per_snapshot_is_ridge_times_the_columns_of_all_runs(make_run, channels, count):
    runs = [make_run(seed=seed) for seed in range(count)]
    model = HankelDMDc(3, 8, 0.2, ridge_scale="per_snapshot").fit(runs, **channels)
    total = count * 391
    assert sum(columns(model)) == total
    assert model.training.ridge == pytest.approx(0.2 * total)
    same = HankelDMDc(3, 8, 0.2 * total).fit(runs, **channels)
    np.testing.assert_array_equal(model.A, same.A)


def test_exact_rows_are_the_shift_and_leave_the_regressed_rows_alone(run, channels):
    exact = HankelDMDc(2, 4, 5.0, delay_rows="exact").fit(run, **channels)
    ridge = HankelDMDc(2, 4, 5.0).fit(run, **channels)
    assert exact.A.shape == ridge.A.shape == (6, 6)
    assert exact.B.shape == ridge.B.shape == (6, 10)
    np.testing.assert_array_equal(exact.A[2:], np.eye(4, 6))
    np.testing.assert_array_equal(exact.B[2:], 0.0)
    # Each row of ridge regression is its own problem; blocking of BLAS may differ in rounding.
    np.testing.assert_allclose(exact.A[:2], ridge.A[:2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(exact.B[:2], ridge.B[:2], rtol=0, atol=1e-12)
    assert np.max(np.abs(ridge.A[2:] - np.eye(4, 6))) > 1e-3


def test_blocks_of_the_model_are_lag_major_in_the_order_of_the_names(make_dataset):
    # heave' = 0.5 heave₋₁ + 0.2 pitch + 0.7 eta₋₂, and pitch is white noise: every coefficient
    # has one place, read off the definition of the extended vectors.
    rng = np.random.default_rng(0)
    pitch, eta = rng.standard_normal((2, 500))
    heave = np.zeros(500)
    for k in range(2, 499):
        heave[k + 1] = 0.5 * heave[k - 1] + 0.2 * pitch[k] + 0.7 * eta[k - 2]
    run = make_dataset(DT * np.arange(500), heave=heave, pitch=pitch, eta_fwd=eta)
    model = HankelDMDc(1, 2, 0.0, standardize=False).fit(
        run, states=["pitch", "heave"], inputs=["eta_fwd"]
    )
    # Heave is reproduced exactly, white pitch is not: heave has no noise.
    np.testing.assert_allclose(model.A[1], [0.2, 0.0, 0.0, 0.5], rtol=0, atol=1e-9)
    np.testing.assert_allclose(model.B[1], [0.0, 0.0, 0.7], rtol=0, atol=1e-9)


def test_a_rank_takes_the_place_of_ridge(run, channels):
    model = HankelDMDc(3, 8, 0.0, rank=5).fit(run, **channels)
    assert (model.training.rank, model.training.method, model.training.ridge) == (5, "svd", 0.0)
    both = np.concatenate([model.A, model.B], axis=1)
    assert np.linalg.matrix_rank(both, tol=1e-9 * np.linalg.norm(both)) == 5
    assert "rank 5" in model.summary()
    with pytest.warns(SeakeepWarning, match="ridge = 2 is not used. Set ridge=0 to say so"):
        HankelDMDc(3, 8, 2.0, rank=5)


def test_the_paper_preset_has_the_papers_numbers():
    spec = HankelDMDc.paper(encounter_period=1.64, dt=1.64 / 32)
    assert spec == HankelDMDc(
        32,
        160,
        100.0,
        window=640,
        history="before",
        delay_rows="ridge",
        ridge_scale="absolute",
        rank=None,
        standardize=True,
        alignment=None,
    )


def test_the_recommended_preset_uses_all_of_the_runs_and_exact_rows():
    spec = HankelDMDc.recommended(encounter_period=1.64, dt=1.64 / 32)
    assert spec == HankelDMDc(
        *(32, 96, "rollout"),
        window=None,
        delay_rows="exact",
        ridge_scale="per_snapshot",
        alignment={"mode": "dispersion", "surge": "predicted", "optional": True},
        lead=24,
        readouts="auto",
        select={
            **dict.fromkeys(("observables", "alignment", "lead", "memory"), True),
            "horizon": (15, 45),
            "period": 1.64,
        },
    )
