"""The comparison's tables, files and figures."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal
from tables import rows_of

from seakeep.files import check_output
from seakeep.report.comparison import (
    band_findings,
    comparison_blocks,
    difference_blocks,
    forecast_header,
    model_blocks,
    nowcast_blocks,
    winner,
    write_comparison,
    write_differences,
    write_forecast,
)
from seakeep.study import Comparison, at_full_scale, comparison_table, difference_table, in_degrees

pytest.importorskip("matplotlib")


from seakeep.report.figures.checks import coherence
from seakeep.report.figures.errors import error_figure, nowcast_figure
from seakeep.report.figures.histories import overlay_figure

TIME = np.arange(1, 401) * 0.1
UNITS = {"heave": "m", "pitch": "rad", "mooring_stern": "N"}


def comparison(factor=0.9, slack=False, size=1.0):
    """A forecast that is a factor times the measurement, of loads of a size."""
    load = (1e-6 if slack else size) * np.sin(3 * TIME)
    values = {"heave": np.sin(TIME), "pitch": 0.1 * np.cos(TIME), "mooring_stern": load}
    spreads = {"heave": 0.7, "pitch": 0.07, "mooring_stern": 0.7 * size}
    measured, forecast = (
        xr.Dataset(
            {
                name: ("time", scale * x, {"units": UNITS[name], "training_std": spreads[name]})
                for name, x in values.items()
            },
            coords={"time": TIME},
        )
        for scale in (1.0, factor)
    )
    forecast.attrs = {"start": 0.0, "status": "ok"}
    inputs = xr.Dataset({"eta_fwd": measured["heave"].assign_attrs(training_std=1.0)})
    return Comparison("r1", "calm", forecast, measured, inputs)


def ensemble(slack=False):
    """The mean of an ensemble with a band of known width around it."""
    single = comparison(factor=1.0, slack=slack)
    mean = single.forecast.assign_attrs(
        status="1 of 5 members diverged", members=5, diverged=1, level=0.9
    )
    with xr.set_options(keep_attrs=True):
        band = xr.concat([mean - 0.2, mean + 0.2], "statistic")
    band = band.assign_coords(statistic=["lower", "upper"])
    # A sinusoid beside the mean: it leaves the band where its modulus is above 0.2.
    heave = (mean["heave"] + 0.4 * np.sin(7 * TIME)).assign_attrs(mean["heave"].attrs)
    return Comparison("r1", "calm", mean, single.measured.assign(heave=heave), single.inputs, band)


def row_of(compared):
    return comparison_table([compared]).isel(run=0)


def test_errors_are_those_that_can_be_computed_by_hand_in_any_unit():
    radians, degrees = (row_of(each) for each in (comparison(), in_degrees(comparison())))
    # Prediction is 0.9 times the measurement: the error is a tenth of it, about zero mean.
    spread = np.sin(TIME).std(ddof=1)
    expected = 0.1 * np.sqrt(np.mean(np.sin(TIME) ** 2)) / spread
    heave = radians.sel(channel="heave")
    assert_allclose(heave["nrmse"], expected, rtol=1e-12)  # rounding of sums
    assert_allclose(heave["training_nrmse"], expected * spread / 0.7, rtol=1e-12)
    fit = 100 * (1 - expected * np.sqrt(TIME.size / (TIME.size - 1)))
    assert_allclose(heave["fit"], fit, rtol=1e-12)
    assert_allclose(radians["sd_ratio"].sel(channel="pitch"), 0.9, rtol=1e-12)
    for measure in ("nrmse", "training_nrmse"):
        assert_allclose(radians[measure], degrees[measure], rtol=1e-12)
    pitch = degrees.sel(channel="pitch")
    assert str(pitch["channel_units"].values) == "deg"
    assert pitch["measured_max"] == pytest.approx(np.degrees(0.1 * np.cos(TIME).max()))


def test_the_band_of_an_ensemble_is_judged_by_hand():
    table, outside = row_of(ensemble()), np.mean(np.abs(0.4 * np.sin(7 * TIME)) > 0.2)
    heave, spread = table.sel(channel="heave"), float(ensemble().measured["heave"].std(ddof=1))
    assert_allclose(heave["coverage"], 100 * (1 - outside), rtol=1e-12)
    assert_allclose(heave["band_width"], 0.4, rtol=1e-12)
    assert_allclose(heave["relative_band_width"], 0.4 / spread, rtol=1e-12)
    assert (table["members"], table["diverged"], table["level"]) == (5, 1, 0.9)
    assert ensemble().complete
    for judged, names in ((table, UNITS), (row_of(ensemble(slack=True)), ["heave", "pitch"])):
        mean = judged["coverage"].sel(channel=list(names)).mean()  # without a slack line
        assert_allclose(judged["mean_coverage"], mean, rtol=1e-12)
    endless = ensemble()
    endless.band["heave"].loc[{"statistic": "upper"}] = np.inf
    judged = row_of(endless)
    assert np.isnan(judged["coverage"].sel(channel="heave"))
    assert judged["mean_coverage"] == judged["coverage"].mean()
    degrees = row_of(in_degrees(ensemble()))
    assert_array_equal(table["coverage"], degrees["coverage"])
    assert degrees["band_width"].sel(channel="pitch") == pytest.approx(np.degrees(0.4))


def test_models_stand_beside_each_other_and_beside_what_they_must_beat(tmp_path):
    tables = {
        name: comparison_table([comparison(factor)])
        for name, factor in {"ours": 0.9, "hold_last": 0.8, "arx": 0.95, "fir": 0.7}.items()
    }
    averages, channels, extremes = model_blocks(tables)
    assert extremes.title.endswith("extremes of ours")
    low, high = (float(tables["ours"][f"anrmse_{each}"][0]) for each in ("lower", "upper"))
    assert averages.rows[0][:3] == ("ours", "0.100", f"{low:.3f} to {high:.3f}")
    assert channels.rows[0] == ("heave", "0.100", "0.200", "0.050", "0.300")
    rows = rows_of(write_comparison(tables, tmp_path / "t.csv"))
    assert [row["model"] for row in rows[::3]] == list(tables)


def waves_of(period, factor, run):
    """A comparison in regular waves."""
    wave = {"eta_fwd": ("time", np.sin(2 * np.pi * TIME / period), {"units": "m"})}
    return replace(comparison(factor), run=run, inputs=xr.Dataset(wave, coords={"time": TIME}))


def test_several_models_are_compared_by_wave_period_and_over_all_runs(tmp_path):
    runs = {"long": 2.0, "short": 1.0}
    found = {
        name: [waves_of(period, factor, run) for run, period in runs.items()]
        for name, factor in {"ours": 0.9, "theirs": 0.8}.items()
    }
    table = difference_table(found)
    assert_allclose(table["wave_period"], [2.0, 1.0], rtol=1e-3)  # by interpolation
    by_run, changes = difference_blocks(table)
    assert by_run.columns == ("run", "waves, s", "ours", "theirs")
    assert by_run.rows[0] == ("short", "1", "0.100", "0.200")
    assert by_run.rows[-1] == ("mean", "", "0.100", "0.200")
    assert changes.rows[0] == ("ours", "0.100", "", "", "")
    # Twice the error at every instant, in every draw.
    assert changes.rows[1] == ("theirs", "0.200", "2 times", "2 to 2 times", "worse")
    assert winner(table, {"theirs": "fir"}) == "Least error: ours, ANRMSE 0.100."
    turned = difference_table(dict(reversed(found.items())))
    nothing = table.assign(all_anrmse=np.nan * table["all_anrmse"])
    assert winner(nothing, {}) == "No model could be judged."
    told = "Least error: ours, ANRMSE 0.100, −50 % [−50 to −50 %] from theirs."
    assert winner(turned, {}) == told
    unsure = turned.assign(all_upper=abs(turned["all_upper"]))
    assert winner(unsure, {"ours": "fir"}).endswith(
        "from theirs: no model is surely better. Keep theirs."
    )
    third = unsure.isel(model=[0, 0, 1]).assign_coords(model=["theirs", "arx", "ours"])
    for key, value in {"anrmse": 0.15, "change": -0.25, "lower": -0.3, "upper": -0.2}.items():
        third[f"all_{key}"].values[1] = value
    assert winner(third, {"arx": "arx"}).startswith(
        "Least error: ours, ANRMSE 0.100, −50 % [−50 to +50 %] from theirs; surely better: arx, "
        "−25 % [−30 to −20 %] from theirs. To use it, give the campaign file a table [models.arx]"
    )
    rows = rows_of(write_differences(table, tmp_path / "d.csv"))
    assert [row["run"] for row in rows] == [*runs, *runs, "", ""]
    large = {k: [at_full_scale(each, 4.0) for each in of] for k, of in found.items()}
    table = difference_table(large)
    assert_allclose(table["wave_period"], [4.0, 2.0], rtol=1e-3)
    assert next(difference_blocks(table)).title.endswith(": ANRMSE, full scale (1:4)")
    rows = rows_of(write_differences(table, tmp_path / "full.csv"))
    assert {row["scale_factor"] for row in rows if row["run"]} == {"4.0"}
    (only,) = difference_blocks(difference_table({k: each[:1] for k, each in found.items()}))
    assert only.title == "long: change of ANRMSE from ours"


def assert_labels_fit(figure):
    """No label reaches beyond its panel, or the figure."""
    figure.draw_without_rendering()
    for axes in figure.axes:
        label = axes.yaxis.label.get_window_extent()
        assert label.height <= axes.get_window_extent().height
        assert label.x0 >= 0


def test_names_of_ten_runs_and_long_ones_of_channels_do_not_meet():
    runs = [f"Run {k}, irregular_Hs0.06_Tp{k}_with_wind and current" for k in range(10)]
    found = {name: [waves_of(1.0, 0.9, run) for run in runs] for name in ("ours", "theirs")}
    figure = error_figure(difference_table(found))
    figure.draw_without_rendering()
    (axes,) = figure.axes
    places = [label.get_window_extent() for label in axes.get_xticklabels()]
    assert all(left.x1 < right.x0 for left, right in pairwise(places))
    assert axes.get_window_extent().height > 0.4 * figure.bbox.height
    names = ["vertical velocity at the moonpool (MRU 5)", "force_of_the_forward_portside_line_lc_4"]
    ones = xr.DataArray(np.ones((2, 3)), dims=("state", "frequency"))
    result = xr.Dataset(
        {"ordinary": ones.expand_dims("input"), "spectrum": ones, "multiple": ones},
        coords={"state": names, "input": ["eta"], "frequency": [0.1, 0.2, 0.3]},
    )
    assert_labels_fit(coherence(result))


@pytest.mark.parametrize(("lead_time", "words"), [(0.5, "0.500"), (2.0, "at least 2.000")])
def test_a_lead_time_as_long_as_the_forecast_is_a_bound(lead_time, words):
    over, facts = ("lead", "channel"), {"share": 0.5, "starts": 24}
    made = xr.Dataset(
        {key: (over, [[0.1], [0.2]]) for key in ("error", "claimed", "coverage")}
        | {"lead_time": ("channel", [lead_time])},
        {"lead": [1.0, 2.0], "channel": ["heave"]},
    )
    results = {"m": made.expand_dims(run=["r"]).assign_attrs(facts)}
    (table,) = nowcast_blocks(results)
    assert table.rows[0][:2] == ("heave", words)
    assert nowcast_figure(results, "r").get_suptitle() == "r"


def test_a_forecast_says_per_instant_until_when_it_reads_the_waves(tmp_path):
    data, attrs = {"heave": ("time", [1.0, 2.0])}, {"reads_input_until": 0.6}
    forecast = xr.Dataset(data, {"time": [0.1, 0.2]}, attrs)
    path = write_forecast(forecast, tmp_path / "f.csv")
    assert path.read_text().splitlines() == [
        "time [s],heave [],waves read until [s]", "0.1,1.0,0.7", "0.2,2.0,0.8",
    ]  # fmt: skip
    check_output(path, "forecast", header=forecast_header(["heave"]))  # may be replaced
    forecast.attrs["reads_input_until"] = -0.1  # a model without a look-ahead
    assert write_forecast(forecast, path).read_text().splitlines()[0] == "time [s],heave []"


def test_the_figure_judges_as_the_table_does_where_loads_have_a_prefix(tmp_path):
    judged = comparison(size=5000.0)
    judged.forecast["heave"].values *= 0.5  # errors differ between channels
    figure = overlay_figure({"": judged})
    assert "[kN]" in figure.axes[2].get_ylabel()
    assert f"ANRMSE {float(row_of(judged)['anrmse']):.3f}" in figure.get_suptitle()
    small, large = comparison(), at_full_scale(comparison(), 120.0)
    figure = overlay_figure({"": large})
    title = "r1 · full scale, λ = 120 · sea state as stated: calm · ANRMSE"
    assert figure.get_suptitle().startswith(title)
    assert "full scale" not in overlay_figure({"": small}).get_suptitle()
    # 1 N at model scale is 120³ N, water of one density.
    values = figure.axes[2].lines[0].get_ydata()
    assert figure.axes[2].get_ylabel().endswith("[MN]")
    assert values.max() == pytest.approx(1e-6 * 120**3 * small.measured["mooring_stern"].max())
    table = comparison_table([large])
    rows = rows_of(write_comparison({"m": table}, tmp_path / "t.csv"))
    assert {(row["scale"], row["scale_factor"]) for row in rows} == {("full", "120.0")}
    extremes = "r1: extremes, full scale (1:120)"
    titles = [each.title for each in comparison_blocks(table)]
    assert titles[::2] == ["r1: forecast against measurement, full scale (1:120)", extremes]
    titles = [each.title for each in model_blocks({"ours": table, "theirs": table})]
    assert titles[::2] == [
        "r1: models against measurement, full scale (1:120)",
        "r1: extremes of ours, full scale (1:120)",
    ]
    rows = rows_of(write_forecast(large.forecast, tmp_path / "f.csv"))
    assert {row["scale_factor"] for row in rows} == {"120.0"}
    assert "scale" not in write_forecast(small.forecast, tmp_path / "s.csv").read_text()


def test_only_columns_with_an_average_have_its_row():
    errors, bounds, extremes = comparison_blocks(comparison_table([comparison()]))
    channels = ["heave", "pitch", "mooring_stern"]
    for table in (errors, bounds):
        assert [row[0] for row in table.rows] == [*channels, "average"]
        assert [*table.averages] == [3]
    assert errors.rows[-1][1] == "0.100"
    assert [row[0] for row in extremes.rows] == channels
    assert [*extremes.averages] == []


def test_each_channel_has_a_panel_and_inputs_share_one_with_those_of_their_unit():
    judged = comparison()
    words = "Bow line LC-1 (FWD), 2 $ shackles, 1 $ pin"
    judged.measured["pitch"].attrs["long_name"] = "Trim angle (MRU-5)"
    judged.measured["mooring_stern"].attrs["long_name"] = words
    wave = judged.inputs["eta_fwd"]
    many = {f"eta_{k + 1}": wave for k in range(9)}
    angle = wave.assign_attrs(units="deg")
    inputs = judged.inputs.assign(rudder=angle, fin=angle, **many)
    inputs["eta_fwd"].attrs["long_name"] = "probe ahead of the bow"
    figure = overlay_figure({"": replace(in_degrees(judged), inputs=inputs)})
    _, pitch, load, waves, angles = figure.axes
    assert pitch.get_ylabel() == "Trim angle (MRU-5)\n$\\theta$ [deg]"
    lines = load.get_ylabel().replace(r"\$", "$").split("\n")
    assert " ".join(lines[:-1]) == words
    assert lines[-1] == "$M_\\mathrm{stern}$ [N]"
    assert waves.get_ylabel() == "wave elevations\n[m]"
    assert angles.get_ylabel() == "inputs\n[deg]"
    for axes, words in ((waves, ["probe ahead of the bow", *many]), (angles, ["rudder", "fin"])):
        assert [text.get_text() for text in axes.get_legend().get_texts()] == words
    assert_labels_fit(figure)


@pytest.mark.parametrize(
    ("least", "words"),
    [(88.0, "which is what it claims (88 % of pitch, not what it claims)."),
     (91.0, "which is what it claims.")],
)  # fmt: skip
def test_the_worst_channel_of_a_band_is_named_where_its_verdict_is_another(least, words):
    coverage = xr.DataArray([[99.0, least, np.nan]], dims=("run", "channel"))
    facts = {"mean_coverage": 94.0, "diverged": 0, "members": 20, "level": 0.95, "band": "members"}
    table = xr.Dataset(
        {"coverage": coverage} | facts, {"run": ["R1"], "channel": ["heave", "pitch", "surge"]}
    )
    assert words in band_findings(table)[0]
