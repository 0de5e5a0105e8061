"""Which samples train a model, and what is taken from them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from records import table
from said import warned

from seakeep import HankelDMDc


def test_a_stop_between_two_samples_takes_the_one_before(run, channels):
    for lead in (0, 2):
        spec = HankelDMDc(3, 8, 1.0, window=100, lead=lead)
        model = spec.fit(run, stop=10.035, **channels)
        same = spec.fit(run, stop=10.0, **channels)
        assert model.training.stop == same.training.stop == pytest.approx((10.0,))
        assert_allclose(model.training.first, (5.05,))
        assert_array_equal(model.coefficients, same.coefficients)


@pytest.mark.parametrize("history", ["before", "inside"])
def test_moments_are_those_of_the_windows_pooled_with_ddof_one(make_run, channels, history):
    runs = [make_run(seed=1), make_run(samples=300, seed=2)]
    model = HankelDMDc(3, 8, 1.0, window=120, history=history).fit(runs, **channels)
    scales = model.state_scale, model.input_scale
    for names, scale in zip(channels.values(), scales, strict=True):
        pooled = np.concatenate([table(run, names)[-120:] for run in runs])
        # The same sums in the same order, or nearly.
        expected = pooled.mean(axis=0), pooled.std(axis=0, ddof=1)
        assert_allclose([scale.mean, scale.std], expected, rtol=1e-13)


def test_a_rank_takes_the_place_of_ridge(run, channels):
    model = HankelDMDc(3, 8, 0.0, rank=5).fit(run, **channels)
    assert (model.training.rank, model.training.method, model.training.ridge) == (5, "svd", 0.0)
    assert "rank 5" in model.summary()
    with warned("ridge = 2 is not used. Set ridge=0 to say so"):
        HankelDMDc(3, 8, 2.0, rank=5)


def test_the_recommended_preset_uses_all_of_the_runs_and_exact_rows():
    assert HankelDMDc.recommended(encounter_period=1.64, dt=1.64 / 32) == HankelDMDc(
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
