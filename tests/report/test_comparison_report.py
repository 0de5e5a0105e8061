"""The comparison's table and figure."""

import csv
import itertools
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from seakeep.files import check_output
from seakeep.report.comparison import (
    band_findings,
    comparison_blocks,
    difference_blocks,
    forecast_header,
    model_blocks,
    write_comparison,
    write_differences,
    write_forecast,
    write_nowcasts,
)
from seakeep.report.style import LINES
from seakeep.study import (
    Comparison,
    at_full_scale,
    comparison_table,
    difference_table,
    forecast_at_full_scale,
    in_degrees,
)

TIME = np.arange(1, 401) * 0.1


def comparison(factor=0.9, status="ok", slack=False):
    heave = np.sin(TIME)
    pitch = 0.1 * np.cos(TIME)
    line = 1e-6 * np.sin(3 * TIME) if slack else np.sin(3 * TIME)
    measured = xr.Dataset(
        {
            "heave": ("time", heave, {"units": "m"}),
            "pitch": ("time", pitch, {"units": "rad"}),
            "mooring_stern": ("time", line, {"units": "N"}),
        },
        coords={"time": TIME},
    )
    forecast = factor * measured
    for name, variable in forecast.data_vars.items():
        variable.attrs = {**measured[name].attrs, "training_std": 0.7}
    forecast["pitch"].attrs["training_std"] = 0.07
    forecast.attrs = {"start": 0.0, "status": status}
    inputs = xr.Dataset({"eta_fwd": ("time", heave, {"units": "m"})}, coords={"time": TIME})
    return Comparison("r1", "calm", forecast, measured, inputs)


def ensemble(half=0.2, diverged=1, slack=False):
    """The mean of an ensemble with a band of known width around it."""
    single = comparison(factor=1.0, slack=slack)
    mean = single.forecast.assign_attrs(
        status=f"{diverged} of 5 members diverged", members=5, diverged=diverged, level=0.9
    )
    band = xr.concat([mean - half, mean + half], "statistic")
    band = band.assign_coords(statistic=["lower", "upper"])
    for name in band.data_vars:
        band[name].attrs = mean[name].attrs
    # A sinusoid beside the mean: it leaves the band where its modulus is above `half`.
    measured = single.measured.copy()
    measured["heave"] = mean["heave"] + 0.4 * np.sin(7 * mean["time"])
    measured["heave"].attrs = mean["heave"].attrs
    return Comparison("r1", "calm", mean, measured, single.inputs, band)


def block_of(table):
    errors, intervals, extremes = comparison_blocks(table)
    low, high = (float(table[f"anrmse_{bound}"][0]) for bound in ("lower", "upper"))
    told = f"{low:.3f} to {high:.3f}" if np.isfinite(low) else "–"
    assert intervals.rows[-1][:2] == ("average", told)
    assert extremes.rows[0][2] == f"{float(table['measured_min'][0, 0]):.4g}"
    return errors


def write_csv(table, path):
    return write_comparison({"m": table}, path)


def test_the_band_of_an_ensemble_is_judged_by_hand():
    judged = ensemble()
    table = comparison_table([judged]).isel(run=0)
    heave = table.sel(channel="heave")
    outside = np.mean(np.abs(0.4 * np.sin(7 * TIME)) > 0.2)
    assert float(heave["coverage"]) == pytest.approx(100 * (1 - outside), rel=1e-12)
    assert float(heave["band_width"]) == pytest.approx(0.4, rel=1e-12)
    spread = float(judged.measured["heave"].std(ddof=1))
    assert float(heave["relative_band_width"]) == pytest.approx(0.4 / spread, rel=1e-12)
    assert float(table["coverage"].sel(channel="pitch")) == 100.0
    assert float(table["mean_coverage"]) == pytest.approx(float(table["coverage"].mean()))
    assert (int(table["members"]), int(table["diverged"]), float(table["level"])) == (5, 1, 0.9)
    assert judged.complete


def test_a_slack_line_is_left_out_of_the_mean_coverage():
    table = comparison_table([ensemble(slack=True)]).isel(run=0)
    judged = table["coverage"].sel(channel=["heave", "pitch"]).mean()
    assert float(table["mean_coverage"]) == pytest.approx(float(judged), rel=1e-12)


def test_degrees_widen_a_band_and_leave_its_coverage():
    radians, degrees = ensemble(), in_degrees(ensemble())
    before, after = (comparison_table([each]).isel(run=0) for each in (radians, degrees))
    np.testing.assert_array_equal(before["coverage"], after["coverage"])
    pitch = after.sel(channel="pitch")
    assert float(pitch["band_width"]) == pytest.approx(np.degrees(0.4), rel=1e-12)
    assert float(pitch["relative_band_width"]) == pytest.approx(
        float(before["relative_band_width"].sel(channel="pitch")), rel=1e-12
    )


def test_tables_and_words_of_a_band(tmp_path):
    table = comparison_table([ensemble()])
    shown = block_of(table)
    assert shown.title == "r1: forecast against measurement, 90 % band"
    assert shown.columns[-2:] == ("in band %", "width in SD")
    assert shown.rows[-1][-2] == f"{float(table['mean_coverage'][0]):.1f}"
    (words,) = band_findings(table)
    found = float(table["mean_coverage"][0])
    assert words == (
        f"r1: the 90 % band of 4 members holds {found:.0f} % of the measured instants, not what "
        "it claims. It carries the spread of the members, and no noise or model error; 1 of 5 "
        "members diverged and are left out."
    )
    rows = list(csv.DictReader(write_csv(table, tmp_path / "t.csv").read_text().splitlines()))
    assert float(rows[0]["coverage"]) == float(table["coverage"][0, 0])
    assert (rows[0]["level"], rows[0]["members"], rows[0]["diverged"]) == ("0.9", "5", "1")
    single = comparison_table([comparison()])
    assert band_findings(single) == []
    assert "coverage" not in write_csv(single, tmp_path / "s.csv").read_text()


def test_a_band_that_is_lost_altogether_is_said_to_be():
    judged = ensemble(diverged=5)
    lost = replace(judged, forecast=judged.forecast * np.nan, band=judged.band * np.nan)
    lost.forecast.attrs = judged.forecast.attrs
    assert not lost.complete
    (words,) = band_findings(comparison_table([lost]))
    assert words == ("r1: there is no band to judge; 5 of 5 members diverged and are left out.")


def test_the_figure_of_an_ensemble_shows_mean_and_band():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    judged = in_degrees(ensemble())
    figure = overlay_figure(judged)
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert sorted(labels) == ["90 % band", "ensemble mean", "measured"]
    (fill,) = figure.axes[1].collections
    heights = fill.get_paths()[0].vertices[:, 1]
    pitch = judged.band["pitch"]
    assert heights.min() == pytest.approx(float(pitch.min()))
    assert heights.max() == pytest.approx(float(pitch.max()))
    inside = float(comparison_table([judged]).isel(run=0)["coverage"].sel(channel="heave"))
    assert figure.axes[0].get_title("right").endswith(f"{inside:.0f} % in the band")
    figure.draw_without_rendering()
    box = legend.get_window_extent()
    assert box.y1 <= figure.axes[-1].get_tightbbox().y0 + 1  # below the panels, over none


def test_no_name_is_a_formula_in_what_is_written(tmp_path):
    name, data = "=1+1", {key: ("channel", [0.5]) for key in ("error", "claimed", "coverage")}
    made = xr.Dataset(data, {"channel": [name]}).expand_dims(run=[name], lead=[1.0])
    path = write_nowcasts({name: made.assign(lead_time=("channel", [1.0]))}, tmp_path / "n.csv")
    assert path.read_text().splitlines()[1] == "'=1+1,'=1+1,'=1+1,1.0,0.5,0.5,0.5,1.0"
    forecast = xr.Dataset({name: ("time", [1.0])}, {"time": [0.1]})
    path = write_forecast(forecast, tmp_path / "f.csv")
    assert path.read_text().splitlines()[0] == "time [s],'=1+1 []"
    check_output(path, "forecast", header=forecast_header([name]))  # may be replaced


def test_a_forecast_says_per_instant_until_when_it_reads_the_waves(tmp_path):
    data, attrs = {"heave": ("time", [1.0, 2.0])}, {"reads_input_until": 0.6}
    forecast = xr.Dataset(data, {"time": [0.1, 0.2]}, attrs)
    path = write_forecast(forecast, tmp_path / "f.csv")
    assert path.read_text().splitlines() == [
        "time [s],heave [],waves read until [s]", "0.1,1.0,0.7", "0.2,2.0,0.8",
    ]  # fmt: skip
    check_output(path, "forecast", header=forecast_header(["heave"]))  # may be replaced
    forecast.attrs["reads_input_until"] = -0.1  # a model without a look-ahead
    text = write_forecast(forecast, path).read_text()
    assert text.splitlines()[0] == "time [s],heave []"


def test_labels_of_many_channels_are_whole_and_apart():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    plain = comparison()
    motions = ("surge", "heave", "pitch", "yaw", "roll")
    names = [f"{each}{kind}" for each in motions for kind in ("", "_rate", "_acceleration")]

    def wide(data):
        units = {"heave": "m", "surge": "m"}
        made = {
            name: data["heave"].assign_attrs(units=units.get(name.split("_")[0], "rad"))
            for name in names
        }
        return xr.Dataset(made, attrs=data.attrs)

    judged = replace(plain, measured=wide(plain.measured), forecast=wide(plain.forecast))
    for name in names:
        judged.forecast[name].attrs["training_std"] = 0.7
    figure = overlay_figure(judged)
    figure.draw_without_rendering()
    labels = [axes.yaxis.label.get_window_extent() for axes in figure.axes]
    for upper, lower in itertools.pairwise(labels):
        assert lower.y1 < upper.y0
    for axes, box in zip(figure.axes, labels, strict=True):
        assert box.height <= axes.get_window_extent().height  # none reaches beyond its panel
    assert all(box.x0 >= 0 and box.y0 >= 0 for box in labels)
    # The legend of the inputs stands over the left end of their own panel.
    box = figure.axes[-1].get_legend().get_window_extent()
    panel = figure.axes[-1].get_window_extent()
    assert abs(box.x0 - panel.x0) < 20  # pixels, of a panel 700 wide
    assert box.y0 == pytest.approx(panel.y1, abs=12)


def test_table_holds_what_can_be_computed_by_hand():
    table = comparison_table([comparison()]).isel(run=0)
    samples = TIME.size
    # Prediction is 0.9 times the measurement: the error is a tenth of it, about zero mean.
    deviation = np.sin(TIME)
    expected = 0.1 * np.sqrt(np.mean(deviation**2)) / deviation.std(ddof=1)
    assert float(table["nrmse"].sel(channel="heave")) == pytest.approx(expected, rel=1e-12)
    assert float(table["sd_ratio"].sel(channel="pitch")) == pytest.approx(0.9, rel=1e-12)
    assert float(table["measured_max"].sel(channel="heave")) == deviation.max()
    fit = 100 * (1 - expected * np.sqrt(samples / (samples - 1)))
    assert float(table["fit"].sel(channel="heave")) == pytest.approx(fit, rel=1e-12)
    known = float(comparison().forecast["heave"].attrs["training_std"])
    in_training = expected * deviation.std(ddof=1) / known
    assert float(table["training_nrmse"].sel(channel="heave")) == pytest.approx(in_training, 1e-12)


def test_degrees_change_extremes_and_no_error_measure():
    radians, degrees = comparison(), in_degrees(comparison())
    before, after = comparison_table([radians]), comparison_table([degrees])
    for measure in ("nrmse", "training_nrmse"):
        np.testing.assert_allclose(before[measure], after[measure], rtol=1e-12)
    pitch = after.isel(run=0).sel(channel="pitch")
    assert str(pitch["channel_units"].values) == "deg"
    assert float(pitch["measured_max"]) == pytest.approx(np.degrees(0.1 * np.cos(TIME).max()))


def test_a_slack_line_is_left_out_and_shown_as_such():
    table = comparison_table([comparison(slack=True)]).isel(run=0)
    assert np.isnan(float(table["nrmse"].sel(channel="mooring_stern")))
    judged = float(table["nrmse"].sel(channel=["heave", "pitch"]).mean())
    assert float(table["anrmse"]) == pytest.approx(judged, rel=1e-12)
    assert int(table["slack_channels"]) == 1
    shown = block_of(comparison_table([comparison(slack=True)]))
    assert shown.note == "1 still channel left out of the average"
    assert shown.rows[2][1] == "–"
    # Its error in training SD says something all the same, and counts.
    every = float(table["training_nrmse"].mean(skipna=False))
    assert float(table["training_anrmse"]) == pytest.approx(every, rel=1e-12)


def test_csv_has_a_row_a_channel_and_all_digits(tmp_path):
    table = comparison_table([comparison()])
    text = write_csv(table, tmp_path / "t.csv").read_text()
    rows = list(csv.DictReader(text.splitlines()))
    assert [row["channel"] for row in rows] == ["heave", "pitch", "mooring_stern"]
    assert float(rows[0]["nrmse"]) == float(table["nrmse"][0, 0])
    assert rows[0]["status"] == "ok"


def test_terminal_table_names_the_status_of_a_diverged_run():
    table = block_of(comparison_table([comparison(status="diverged at t = 3 s")]))
    assert table.note == "diverged at t = 3 s"


def test_models_stand_beside_each_other_and_beside_what_they_must_beat(tmp_path):
    tables = {
        name: comparison_table([comparison(factor)])
        for name, factor in {"ours": 0.9, "hold_last": 0.8, "arx": 0.95, "fir": 0.7}.items()
    }
    references = {"hold last": ["hold_last"], "best linear": ["arx", "fir"]}
    averages, skill, channels, extremes = model_blocks(tables, references)
    assert extremes.title.endswith("extremes of ours")
    assert averages.columns == ("model", "ANRMSE", "95 %", "in training SD", "NAMMAE")
    assert averages.rows[0][:2] == ("ours", "0.100")
    assert skill.columns == ("model", "from hold last", "from best linear")
    assert skill.rows == [("ours", "−50 %", "2 times")]  # errors of 0.1 against 0.2 and 0.05
    assert channels.rows[0] == ("heave", "0.100", "0.200", "0.050", "0.300")
    path = write_comparison(tables, tmp_path / "t.csv")
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [row["model"] for row in rows[::3]] == list(tables)


def waves_of(period, factor, run):
    """A comparison in regular waves."""
    wave = {"eta_fwd": ("time", np.sin(2 * np.pi * TIME / period), {"units": "m"})}
    inputs = xr.Dataset(wave, coords={"time": TIME})
    return replace(comparison(factor), run=run, inputs=inputs)


def test_several_models_are_compared_by_wave_period_and_over_all_runs(tmp_path):
    runs = {"long": 2.0, "short": 1.0}
    found = {
        name: [waves_of(period, factor, run) for run, period in runs.items()]
        for name, factor in {"ours": 0.9, "theirs": 0.8}.items()
    }
    table = difference_table(found)
    np.testing.assert_allclose(table["wave_period"], [2.0, 1.0], rtol=1e-3)  # by interpolation
    by_run, changes = difference_blocks(table)
    assert by_run.columns == ("run", "waves, s", "ours", "theirs")
    assert by_run.rows[0] == ("short", "1", "0.100", "0.200")
    assert by_run.rows[-1] == ("mean", "", "0.100", "0.200")
    assert changes.rows[0] == ("ours", "0.100", "", "", "")
    # Twice the error at every instant, in every draw.
    assert changes.rows[1] == ("theirs", "0.200", "2 times", "2 to 2 times", "worse")
    path = write_differences(table, tmp_path / "d.csv")
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [(row["run"], row["model"]) for row in rows] == [
        *((run, model) for model in found for run in runs),
        *(("", model) for model in found),
    ]
    (only,) = difference_blocks(difference_table({k: each[:1] for k, each in found.items()}))
    assert only.title == "long: change of ANRMSE from ours"


def test_figures_of_several_models_name_each_of_them():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.errors import error_figure
    from seakeep.report.figures.histories import overlay_figure

    found = {"ours": [waves_of(1.0, 0.9, "r")], "theirs": [waves_of(1.0, 0.5, "r")]}
    figure = overlay_figure({name: each[0] for name, each in found.items()})
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["measured", "ours, ANRMSE 0.100", "theirs, ANRMSE 0.500"]
    assert figure.axes[0].get_title(loc="right") == "NRMSE 0.100 · 0.500"
    assert "ANRMSE" not in figure.get_suptitle()
    axes = error_figure(difference_table(found)).axes[0]
    assert axes.get_xticklabels()[0].get_text() == "r\n1 s"
    assert axes.get_legend_handles_labels()[1] == list(found)


def test_the_figure_judges_as_the_table_does_where_loads_are_shown_in_kilonewtons():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    plain = comparison()
    large = {name: data.copy() for name, data in (("m", plain.measured), ("f", plain.forecast))}
    for data in large.values():
        attrs = data["mooring_stern"].attrs
        data["mooring_stern"] = 5000.0 * data["mooring_stern"]
        data["mooring_stern"].attrs = attrs
    large["f"]["mooring_stern"].attrs = {"units": "N", "training_std": 3500.0}
    large["f"]["heave"] = 0.5 * large["f"]["heave"]  # errors differ between channels
    large["f"]["heave"].attrs = plain.forecast["heave"].attrs
    judged = replace(plain, measured=large["m"], forecast=large["f"])
    expected = float(comparison_table([judged])["anrmse"][0])
    figure = overlay_figure(judged)
    assert "[kN]" in figure.axes[2].get_ylabel()
    assert f"ANRMSE {expected:.3f}" in figure.get_suptitle()


def test_figure_has_a_row_a_channel_with_units_and_no_overlap():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    figure = overlay_figure(in_degrees(comparison()))
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "heave\n$z$ [m]",
        "pitch\n$\\theta$ [deg]",
        "stern mooring load\n$M_\\mathrm{stern}$ [N]",
        "wave elevation fwd\n$\\eta_\\mathrm{fwd}$ [m]",
    ]
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    for upper, lower in itertools.pairwise(boxes):
        assert upper.y0 >= lower.y1 - 1  # a pixel of line width
    assert "ANRMSE 0.100" in figure.get_suptitle()
    assert figure.axes[-1].get_xlabel() == "time [s]"


def test_inputs_share_a_panel_with_those_of_their_unit_only():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    judged = comparison()
    elevation = judged.inputs["eta_fwd"]
    more = judged.inputs.assign(
        rudder=elevation.assign_attrs(units="deg"), eta_aft=elevation, fin=elevation
    )
    more["fin"].attrs = {"units": "deg"}
    figure = overlay_figure(replace(judged, inputs=more))
    *_, waves, angles = figure.axes
    assert waves.get_ylabel() == "wave elevations\n[m]"
    assert angles.get_ylabel() == "inputs\n[deg]"
    told = [[text.get_text() for text in axes.get_legend().get_texts()] for axes in (waves, angles)]
    assert told == [["eta_fwd", "eta_aft"], ["rudder", "fin"]]
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in (waves, angles)]
    assert boxes[0].y0 >= boxes[1].y1 - 1  # a pixel of line width


def lengthened(short):
    """The same, repeated over 600 s."""
    time = np.arange(1, 6001) * 0.1
    parts = {}
    for key in ("forecast", "measured", "inputs", "band"):
        each = getattr(short, key)
        if each is not None:
            parts[key] = each.interp(time=np.mod(time, 39.0) + 0.5).assign_coords(time=time)
            parts[key].attrs = each.attrs
    return replace(short, **parts)


@pytest.mark.parametrize("make", [comparison, ensemble])
def test_long_records_get_envelopes_and_an_enlarged_part(make):
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    long = lengthened(make())
    figure = overlay_figure(long)
    assert len(figure.axes) == 8
    low, high = figure.axes[1].get_xlim()
    assert high - low < 0.4 * 600
    # Nothing of the whole record is drawn as a line: a step a period, from its least to its most.
    assert not figure.axes[0].lines
    measured = figure.axes[0].patches[0].get_data()
    assert 80 < len(measured.values) <= 150
    assert measured.values.max() == pytest.approx(float(long.measured["heave"].max()))
    assert measured.baseline.min() == pytest.approx(float(long.measured["heave"].min()))
    assert np.all(measured.values >= measured.baseline)


def test_an_envelope_ends_where_a_forecast_is_lost():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    long = lengthened(comparison(status="diverged at t = 300 s"))
    lost = long.forecast.where(long.forecast["time"] < 300.0)
    lost.attrs = long.forecast.attrs
    figure = overlay_figure(replace(long, forecast=lost))
    figure.draw_without_rendering()
    reached = figure.axes[0].patches[1].get_data()
    known = np.isfinite(reached.values)
    assert 0.4 < known.mean() < 0.6
    assert not np.any(known[np.argmin(known) :])


def named(judged, **long_names):
    """The same, with what a campaign calls channels."""
    for name, words in long_names.items():
        for data in (judged.measured, judged.forecast, judged.inputs):
            if name in data:
                data[name].attrs["long_name"] = words
    return judged


def test_labels_are_what_the_campaign_calls_a_channel():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    words = "Bow line LC-1 (FWD), 2 $ shackles, 1 $ pin"
    judged = named(comparison(), pitch="Trim angle (MRU-5)", mooring_stern=words)
    again = named(judged, heave="heave", eta_fwd="probe ahead of the bow")  # canonical words stay
    figure = overlay_figure(in_degrees(again))
    figure.draw_without_rendering()
    shown = [axes.yaxis.label for axes in figure.axes]
    assert shown[0].get_text() == "heave\n$z$ [m]"
    assert shown[1].get_text() == "Trim angle (MRU-5)\n$\\theta$ [deg]"
    lines = shown[2].get_text().replace(r"\$", "$").split("\n")
    assert " ".join(lines[:-1]) == words
    assert lines[-1] == "$M_\\mathrm{stern}$ [N]"
    for axes, label in zip(figure.axes, shown, strict=True):
        assert label.get_window_extent().height <= axes.get_window_extent().height
    entry = figure.axes[-1].get_legend().get_texts()[0]
    assert entry.get_text() == "probe ahead of the bow"


def test_a_figure_at_full_scale_says_so_and_shows_loads_with_a_prefix(tmp_path):
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    small = comparison()
    large = at_full_scale(small, 120.0)
    figure = overlay_figure(large)
    title = figure.get_suptitle()
    assert title.startswith("r1 · full scale, λ = 120 · sea state as stated: calm · ANRMSE")
    assert "full scale" not in overlay_figure(small).get_suptitle()
    load = figure.axes[2]
    assert load.get_ylabel().endswith("[MN]")
    # 1 N at model scale is 120³ N, water of one density.
    values = load.lines[0].get_ydata()
    assert values.max() == pytest.approx(1e-6 * 120**3 * small.measured["mooring_stern"].max())
    assert not load.yaxis.get_offset_text().get_text()
    table = comparison_table([large])
    rows = list(csv.DictReader(write_csv(table, tmp_path / "t.csv").read_text().splitlines()))
    assert {(row["scale"], row["scale_factor"]) for row in rows} == {("full", "120.0")}
    assert "full scale (1:120)" in block_of(table).title
    path = write_forecast(large.forecast, tmp_path / "f.csv")
    lines = list(csv.DictReader(path.read_text().splitlines()))
    assert {line["scale_factor"] for line in lines} == {"120.0"}
    path = write_forecast(small.forecast, tmp_path / "s.csv")
    assert "scale" not in path.read_text().splitlines()[0]


@pytest.mark.parametrize("count", [5, 10])
def test_many_inputs_are_told_apart(count):
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    judged = comparison()
    elevation = judged.inputs["eta_fwd"]
    names = [f"eta_{number + 1}" for number in range(count)]
    many = xr.Dataset(dict.fromkeys(names, elevation))
    figure = overlay_figure(replace(judged, inputs=many))
    lines = figure.axes[-1].lines[:count]
    assert len({line.get_color() for line in lines}) == min(count, 9)
    words = [text.get_text() for text in figure.axes[-1].get_legend().get_texts()]
    assert words == names


def test_a_mean_lies_over_a_thin_measurement_over_the_band():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    axes = overlay_figure(ensemble()).axes[0]
    measured, mean = axes.lines[:2]
    assert (measured.get_label(), mean.get_label()) == ("measured", "ensemble mean")
    assert axes.collections[0].get_zorder() < measured.get_zorder() <= mean.get_zorder()
    assert measured.get_linewidth() < mean.get_linewidth()
    gaps = LINES["ensemble"]["linestyle"][1][1::2]
    assert min(gaps) >= 2  # line widths, in which the measurement shows


def test_envelopes_keep_off_the_frame():
    pytest.importorskip("matplotlib")
    from seakeep.report.figures.histories import overlay_figure

    long = lengthened(comparison())
    axes = overlay_figure(long).axes[0]
    low, high = axes.get_ylim()
    assert low < float(long.measured["heave"].min())
    assert high > float(long.measured["heave"].max())


def test_statuses_follow_the_clock_of_full_scale():
    single = comparison(status="diverged at t = 3.5 s")
    assert at_full_scale(single, 4.0).status == "diverged at t = 7 s"
    assert at_full_scale(comparison(), 4.0).status == "ok"
    members = xr.Dataset(
        {
            "heave": (("member", "time"), np.ones((2, 3)), {"units": "m"}),
            "status": ("member", np.array(["ok", "diverged at t = 2 s"])),
        },
        coords={"time": [1.0, 2.0, 3.0]},
        attrs={"status": "1 of 2 members diverged", "start": 0.5},
    )
    full = forecast_at_full_scale(members, 4.0)
    assert list(full["status"].values) == ["ok", "diverged at t = 4 s"]
    assert full.attrs["status"] == "1 of 2 members diverged"
    assert full.attrs["start"] == 1.0


def test_without_matplotlib_the_message_names_the_extra(monkeypatch):
    import builtins

    from seakeep.errors import RequestError
    from seakeep.report.style import figure_style

    real = builtins.__import__

    def without(name, *args, **keywords):
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *args, **keywords)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RequestError, match=r"pip install 'seakeep\[figures\]'"), figure_style():
        pass


def test_tables_say_what_a_forecast_was_conditional_on(tmp_path):
    judged = comparison()
    notes = {"conditional_on": "surge", "probe_offset": 38.8, "probe_offset_spread": 1.2}
    notes["reads_input_until"] = 3.24
    judged.forecast.attrs.update(notes)
    table = comparison_table([judged])
    note = (
        "conditional on measured surge; reads the waves up to 3.24 s after each instant; "
        "probe offset 38.8 ± 1.2 m"
    )
    assert block_of(table).note == note
    rows = list(csv.DictReader(write_csv(table, tmp_path / "t.csv").read_text().splitlines()))
    assert {row["conditional_on"] for row in rows} == {"surge"}
    assert (float(rows[0]["probe_offset_spread"]), float(rows[0]["look_ahead"])) == (1.2, 3.24)
    assert block_of(comparison_table([comparison()])).note == ""
