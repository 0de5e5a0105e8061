"""The comparison's table and figure."""

import csv
import itertools

import numpy as np
import pytest
import xarray as xr

from seakeep.report.tables import rich_comparison, write_csv
from seakeep.study import Comparison, comparison_table, in_degrees

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


def test_degrees_change_extremes_and_no_error_measure():
    radians, degrees = comparison(), in_degrees(comparison())
    before, after = comparison_table([radians]), comparison_table([degrees])
    np.testing.assert_allclose(before["nrmse"], after["nrmse"], rtol=1e-12)
    pitch = after.isel(run=0).sel(channel="pitch")
    assert str(pitch["channel_units"].values) == "deg"
    assert float(pitch["measured_max"]) == pytest.approx(np.degrees(0.1 * np.cos(TIME).max()))


def test_a_slack_line_is_left_out_and_shown_as_such():
    table = comparison_table([comparison(slack=True)]).isel(run=0)
    assert np.isnan(float(table["nrmse"].sel(channel="mooring_stern")))
    judged = float(table["nrmse"].sel(channel=["heave", "pitch"]).mean())
    assert float(table["anrmse"]) == pytest.approx(judged, rel=1e-12)
    assert int(table["slack_channels"]) == 1
    shown = rich_comparison(comparison_table([comparison(slack=True)]))
    assert "average (1 still channel left out)" in [c for col in shown.columns for c in col.cells]


def test_csv_has_a_row_a_channel_and_all_digits(tmp_path):
    table = comparison_table([comparison()])
    text = write_csv(table, tmp_path / "t.csv").read_text()
    rows = list(csv.DictReader(text.splitlines()))
    assert [row["channel"] for row in rows] == ["heave", "pitch", "mooring_stern"]
    assert float(rows[0]["nrmse"]) == float(table["nrmse"][0, 0])
    assert rows[0]["status"] == "ok"


def test_terminal_table_names_the_status_of_a_diverged_run():
    table = rich_comparison(comparison_table([comparison(status="diverged at t = 3 s")]))
    cells = [cell for column in table.columns for cell in column.cells]
    assert "average (diverged at t = 3 s)" in cells


def test_figure_has_a_row_a_channel_with_units_and_no_overlap():
    pytest.importorskip("matplotlib")
    from seakeep.report.overlay import overlay_figure

    figure = overlay_figure(in_degrees(comparison()))
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "heave\n$z$ [m]",
        "pitch\n$\\theta$ [deg]",
        "stern mooring load\n$M_\\mathrm{stern}$ [N]",
        "input\n[m]",
    ]
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    for upper, lower in itertools.pairwise(boxes):
        assert upper.y0 >= lower.y1 - 1  # a pixel of line width
    assert "ANRMSE 0.100" in figure.get_suptitle()
    assert figure.axes[-1].get_xlabel() == "time [s]"


def test_long_records_get_an_enlarged_part():
    pytest.importorskip("matplotlib")
    from seakeep.report.overlay import overlay_figure

    short = comparison()
    time = np.arange(1, 6001) * 0.1
    long = Comparison(
        "r",
        "",
        *(
            each.interp(time=np.mod(time, 39.0) + 0.5).assign_coords(time=time)
            for each in (short.forecast, short.measured, short.inputs)
        ),
    )
    long.forecast.attrs = short.forecast.attrs
    figure = overlay_figure(long)
    assert len(figure.axes) == 8
    low, high = figure.axes[1].get_xlim()
    assert high - low < 0.4 * 600


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
    judged.forecast.attrs.update(notes)
    table = comparison_table([judged])
    cells = [cell for column in rich_comparison(table).columns for cell in column.cells]
    assert "conditional on measured surge" in cells
    assert "probe offset 38.8 ± 1.2 m" in cells
    rows = list(csv.DictReader(write_csv(table, tmp_path / "t.csv").read_text().splitlines()))
    assert {row["conditional_on"] for row in rows} == {"surge"}
    assert float(rows[0]["probe_offset_spread"]) == 1.2
    plain = rich_comparison(comparison_table([comparison()]))
    assert not any("conditional" in cell for column in plain.columns for cell in column.cells)
