"""Tables of a study: what they take of its cells, and that they are the named statistics."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from cells import cells
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from said import warned
from tutorial_study import STUDY, put_tutorial, studied, study_of

from seakeep import statistics
from seakeep.core.density import density_grid
from seakeep.metrics import nrmse
from seakeep.models.labelled import TrainingRuns
from seakeep.models.training import gather, system_of
from seakeep.report.tables import ratio_of
from seakeep.study.judge import (
    MEASURES,
    band_tables,
    box_table,
    density_tables,
    difference_table,
    joined,
    median_of,
    side_by_side,
    trend_table,
)
from seakeep.study.plan import make_plan, random_stream


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A study whose truth is known: the measurement of heave, half a centimetre higher."""
    folder = tmp_path_factory.mktemp("study")
    put_tutorial(folder, STUDY.replace("seed = 3", 'seed = 3\ntruth = "truth"'))
    run = make_plan(study_of(folder)).runs["unseen"]
    (folder / "truth").mkdir()
    time = run["time"].values
    half = (time[1] - time[0]) / 2
    finer = time[0] + half * np.arange(-3, 2 * time.size)  # begins before the run
    heave = np.interp(finer, time, run["heave"].values) + 0.005
    true = xr.Dataset({"heave": ("time", heave)}, {"time": finer})
    true.to_netcdf(folder / "truth" / "unseen.nc", engine="h5netcdf")
    return studied(folder)


def test_a_training_set_that_judges_no_window_stands_beside_those_that_do():
    judged = xr.Dataset({"mean": (("window", "time"), np.ones((1, 3)))}, {"window": [0]})
    found = side_by_side([[judged, judged, xr.Dataset()]], {"model": ["a"], "training": [*"xyz"]})
    assert_array_equal(found["mean"].isnull().sum(("model", "window", "time")), [0, 0, 3])


@pytest.mark.filterwarnings("ignore::seakeep.SeakeepWarning")
@pytest.mark.parametrize(
    ("variant", "block", "bandwidth", "crosses"),
    [("paper", "carlstein", "paper", True), ("recommended", "politis_white", "silverman", False)],
)
def test_divergences_are_those_of_the_joined_windows(found, variant, block, bandwidth, crosses):
    table = found.groups["statistics/divergence"]
    test = found.tests["unseen"]
    forecasts = {model: joined(test, model)[0] for model in found.models}
    measured = joined(test, found.models[0])[1]
    for model, predicted in forecasts.items():
        for c, channel in enumerate(found.channels):
            every = [each[..., c] for each in forecasts.values()]
            alone = statistics.jsd_interval(
                predicted[..., c],
                measured[:, c],
                block_length=block,
                bandwidth=bandwidth,
                grid=density_grid(*every, measured[:, c], bandwidth=bandwidth),
                segments=None if crosses else [test.sizes["time"]] * test.sizes["window"],
                n_series=8,
                rng=random_stream(3, f"jsd.unseen.{variant}.{channel}"),
            )
            row = table.sel(model=model, variant=variant, channel=channel)
            for key in ("mean", "lower", "upper", "uncertainty", "noise_floor", "block_length"):
                assert row[key] == getattr(alone, key)
            assert row["noise_floor"] > 0


def test_a_forecast_that_runs_far_away_moves_no_density_of_another(found):
    settings = study_of(found.folder.parent).settings
    test, (kept, wild) = found.tests["unseen"].copy(deep=True), found.models
    before = density_tables(test, found.channels, settings, "unseen", None)["divergence"]
    test["mean"].loc[{"model": wild}] *= 300.0
    after = density_tables(test, found.channels, settings, "unseen", None)["divergence"]
    # On a grid of both models, and on one of its own: sums of smooth functions.
    assert_allclose(after["mean"].sel(model=kept), before["mean"].sel(model=kept), rtol=1e-2)
    assert (after["mean"].sel(model=wild) > before["mean"].sel(model=wild)).all()


def test_the_truth_is_read_at_the_instants_of_the_windows(found):
    test = found.tests["unseen"]
    heave = test.sel(channel="heave")
    assert_near(heave["truth"], heave["measured"] + 0.005, 1e-9)
    assert np.isnan(test["truth"].sel(channel="pitch")).all()
    table = found.groups["statistics/coverage"].sel(test="unseen", model="bayesian", band="members")
    assert list(table["against"].values) == ["measured", "truth"]
    assert np.isnan(table["inside"].sel(against="truth", channel="pitch"))
    for side in ("measured", "truth"):
        band = heave.sel(ensemble="bayesian")
        inside = (band["lower"] <= heave[side]) & (heave[side] <= band["upper"])
        assert_near(table.sel(against=side, channel="heave")["inside"], inside.mean(), 1e-12)
    # Half a centimetre is a tenth of the wave height: the coverages differ.
    assert table["inside"].sel(channel="heave").diff("against").item() != 0


def four():
    """Two training sets and two windows of two channels; the last pair is not judged."""
    time = np.arange(8)
    measured = np.where(time % 2, 1.0, -1.0)[None, :, None] * [[[1.0, 10.0]], [[2.0, 20.0]]]
    lower = np.tile(np.where(time % 4 < 2, -30.0, 25.0)[:, None], (2, 2, 1, 2))
    upper = np.full(lower.shape, 30.0)
    lower[1, 1], upper[1, 1] = np.nan, np.nan
    errors = np.array([[[0.1, 0.3], [0.2, np.nan]], [[0.4, 0.8], [9.0, 9.0]]])
    return cells(
        ["heave", "pitch"], time, measured=measured, judged=[[True, True], [True, False]],
        lower=lower[None], upper=upper[None], error=[[errors, 2 * errors, 3 * errors]],
        mean=np.zeros((1, *lower.shape)),
    )  # fmt: skip


def test_coverage_by_hand_where_a_calibrated_band_is_infinite():
    """What is infinite counts neither as inside nor as wide."""
    margin = [[[1.0, 1.0], [np.inf, 1.0]]]
    calibration = xr.Dataset(
        {"margin": (("ensemble", "training", "channel"), margin)}, {"ensemble": ["m"]}
    )
    tables = band_tables(four(), calibration, 0.95)
    rows = tables["coverage"].sel(model="m", against="measured")
    assert_allclose(rows["inside"], 0.5, rtol=1e-15)
    assert_allclose(rows["below"].sel(band="members"), 0.5, rtol=1e-15)
    # Widths of 60 and of 5 in turns, over SDs √(8/7) times amplitudes 1, 2, 1 (10, 20, 10); of 62
    # and 7 where calibrated, of heave in the first training set alone.
    members = 32.5 / np.sqrt(8 / 7) * np.mean([1, 0.5, 1])
    calibrated = 34.5 / np.sqrt(8 / 7) * np.mean([1, 0.5])
    width = rows["relative_width"].sel(band=["members", "calibrated"])
    assert_allclose(width.sel(channel="heave"), [members, calibrated], rtol=1e-12)
    assert_allclose(width.sel(channel="pitch")[0], members / 10, rtol=1e-12)
    bands = tables["bands"].sel(model="m", band="calibrated", part="all")
    assert_allclose(bands["inside"], 0.5)
    assert_allclose(bands["width"], 34.5)
    endless = calibration.assign(margin=calibration["margin"].max("training"))
    tables = band_tables(four(), endless.expand_dims(training=2), 0.95)
    bands = tables["bands"].sel(model="m", band="calibrated", part="all")
    assert_array_equal(bands["inside"].isnull(), [True, False])


def test_boxes_are_those_of_the_judged_cells():
    table = box_table(four()).sel(model="m", measure="nrmse")
    expected = {
        "heave": [0.1, 0.2, 0.4],
        "pitch": [0.3, 0.8],  # one cell is slack, and left out
        "average": [0.2, 0.2, 0.6],
    }
    for channel, values in expected.items():
        row = table.sel(channel=channel)
        box = statistics.box_statistics(values)
        for key in ("median", "upper_quartile", "lower_whisker", "mean", "count"):
            assert row[key] == pytest.approx(getattr(box, key), rel=1e-12), key
    assert table["left_out"].sel(channel="pitch") == 1


WILD = """
[models.wild]
state_delays = 30
input_delays = 0
ridge = 1e-12
window = 150
delay_rows = "ridge"
alignment = { mode = "effective", surge = "none", celerity = 2.0 }
ridge_scale = "absolute"
"""


def test_forecasts_that_diverge_are_named_and_count_as_infinite(tmp_path):
    put_tutorial(tmp_path, STUDY.replace("length = 6", "length = 20") + WILD)
    with warned(
        r"^6 forecast\(s\) diverged: model 'wild', training set 't00', window 0 "
        r"of 'unseen' \(unseen from .* and 1 more"
    ):
        found = studied(tmp_path)
    assert set(found.groups["statistics/lost"]["model"].values) == {"wild"}
    boxes = found.groups["statistics/boxes"].sel(test="unseen", channel="average", measure="nrmse")
    assert (boxes["count"] == 6).all()
    assert np.isinf(boxes["median"].sel(model="wild"))
    differences = found.groups["statistics/differences"].sel(test="unseen", model="wild")
    at = differences.sel(measure="nrmse", channel="average")
    assert np.isinf(at["change"].sel(other="deterministic"))
    assert np.isnan(at["change"].sel(other="wild"))
    assert np.isfinite(found.groups["statistics/divergence"]["mean"].sel(model="bayesian")).all()


TRAINING = xr.Dataset({"begin": ("training", np.zeros(10))})


def test_differences_between_models_have_intervals_and_verdicts():
    """From 100 cells that share training sets and windows."""
    rng, levels = default_rng(0), {"good": 0.8, "same": 1.0, "noisy": 1.0}
    rows, columns = 0.1 * rng.standard_normal((10, 1)), 0.1 * rng.standard_normal(10)
    shared = (1.0 + rows + columns)[..., None] * [1.0, 2.0]
    errors = np.multiply.outer(np.outer(list(levels.values()), np.ones(len(MEASURES))), shared)
    test = cells(
        ["heave", "pitch"], [0.1, 10.0], levels, error=errors, judged=np.ones((10, 10), bool),
        run=["r"] * 10, start=10.0 * np.arange(10),
    )  # fmt: skip
    noise = 1 + 0.3 * rng.standard_normal((10, 10, 1))
    test["error"].loc[{"model": "noisy", "measure": "nrmse"}] *= noise

    def differences():
        return difference_table(test, TRAINING, rng).sel(measure="nrmse")

    found = differences()
    # The same cells but for a factor: no draw can tell another change than the factor's.
    for key in ("change", "lower", "upper"):
        assert_allclose(found[key].sel(model="good", other="same"), -0.2, rtol=1e-12)
    pairs = {
        ("good", "same"): "better",
        ("same", "good"): "worse",
        ("noisy", "same"): "cannot tell",
    }
    for (model, other), words in pairs.items():
        at = found.sel(model=model, other=other, channel="average")
        assert ratio_of(at).cells()[2] == words
    # Where few redraws lose more than half of the cells, the bound on that side alone is infinite.
    test["error"].loc[{"model": "same", "window": slice(3)}] = np.inf
    at = differences().sel(model="same", other="good", channel="average")
    assert 0 < at["lower"] < at["change"] < np.inf == at["upper"]
    test["error"].loc[{"model": "same"}] = np.inf
    found = differences().sel(channel="average")
    assert np.isinf(found["lower"].sel(model="same", other="good"))
    assert found["upper"].sel(model="good", other="same") == -1.0
    told = [found[key].attrs["long_name"] for key in ("change", "lower", "upper")]
    words = "median error of model over that of other, minus one"
    assert told == [words, f"{words}, lower bound", f"{words}, upper bound"]


def test_growth_is_pooled_over_cells_and_its_interval_holds_it():
    """Windows and channels grow differently, by SDs of 0.2; 100 tables of nine windows of ten."""
    growth, inside, changes = 0.5, 0, []
    for seed in range(100):
        rng = default_rng(seed)
        windows, channels = rng.normal(0, 0.2, (10, 1)), rng.normal(0, 0.2, 9)
        grows = np.broadcast_to(growth + windows + channels, (1, 1, 10, 10, 9)).copy()
        level = np.ones(grows.shape)
        grows[:, :, 0], level[:, :, 0] = np.nan, np.nan
        test = cells(
            range(9), [0.1, 10.0], level=level, growth=grows, judged=np.ones((10, 10), bool),
            error_over_time=np.ones((1, 1, 10, 10, 2)), run=["r"] * 10, start=10.0 * np.arange(10),
        )  # fmt: skip
        at = trend_table(test.assign_coords(band=["all"]), TRAINING, rng).sel(model="m", band="all")
        inside += at["lower"] <= growth <= at["upper"]
        changes.append(float(at["change"]))
    assert_near(np.mean(changes), growth, 0.03)  # a standard error of 0.01
    # Nominally 95: 100 tables have a standard error of 2.2.
    assert inside >= 89


def test_medians_leave_out_what_is_not_judged():
    cells = default_rng(1).standard_normal((3, 8, 2))
    cells[0, :5], cells[1] = np.nan, np.nan
    found = median_of(cells)
    assert_allclose(found[[0, 2]], np.nanmedian(cells[[0, 2]], axis=1))
    assert np.isnan(found[1]).all()


REGULARISED = """
[models.printed]
preset = "paper"
state_delays = 8
input_delays = 16
ridge = 3
window = 100
[output]
regularisation = true
"""


def test_a_model_is_identified_without_ridge_and_truncated_too(tmp_path):
    put_tutorial(tmp_path, STUDY + REGULARISED)
    found = studied(tmp_path)
    assert [name for name in found.groups if name.startswith("regularisation/")] == [
        "regularisation/printed"  # neither exact delay rows nor an ensemble
    ]
    at = found.groups["regularisation/printed"].isel(training=1)
    plan = make_plan(study_of(tmp_path))
    parts, *channels = plan.taught(plan.training[1].spans)
    spec = plan.specs["printed"]
    fitted = spec.fit(parts, *channels)
    # Degrees of freedom of a ridge regression: the trace of its hat matrix.
    data = gather(TrainingRuns(parts, *channels), spec)
    upper = np.triu(system_of((data.states, data.delayed, data.direct), data.windows, spec).gram)
    gram = upper + np.triu(upper, 1).T
    freedom = np.trace(np.linalg.solve(gram + 3 * np.eye(len(gram)), gram))
    assert at["rank"] == round(freedom)
    truncated = replace(spec, ridge=0.0, rank=round(freedom)).fit(parts, *channels)
    for name, model in {"ridge": fitted, "truncated": truncated}.items():
        assert_allclose(at["radius"].sel(variant=name), model.spectral_radius, rtol=1e-12)
    window = plan.tests["unseen"][2]
    forecast = truncated.forecast(plan.runs[window.run], window.start, window.steps)
    error = nrmse(predicted=forecast, measured=plan.runs[window.run])
    expected = [float(error[name]) for name in found.channels]
    assert_allclose(at["truncated_nrmse"].isel(window=2), expected, rtol=1e-6)
    assert (at["seconds"] > 0).all()
