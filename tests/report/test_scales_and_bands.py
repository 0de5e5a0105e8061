"""Tables of errors in two standard deviations, of bands and of choices hold what was put in."""

import json

import numpy as np
import pytest
import xarray as xr

from seakeep.report.sections.errors import bands, scales
from seakeep.report.sections.settings import chosen
from seakeep.study import StudyResult
from seakeep.study.judge import MEASURES, band_parts, box_table


@pytest.fixture
def result():
    """An ensemble in one window of two channels: a wave of SD 2, and a load that stands still."""
    time = np.arange(1, 13)
    wave = np.where(time % 2, 2.0, -2.0) * np.sqrt(11 / 12)  # SD 2 with ddof = 1
    measured = np.stack([wave, np.full(12, 5.0)], axis=1)[None]
    dims = ("training", "window", "time", "channel")
    lower, upper = np.full((1, 1, 12, 2), -10.0), np.full((1, 1, 12, 2), 10.0)
    upper[..., :4, 0] = -9.0  # the first third of the horizon misses the wave
    errors = [[[[0.3, np.nan]]], [[[0.3, np.nan]]], [[[0.075, 1.525]]]]
    test = xr.Dataset(
        {
            "measured": (dims[1:], measured),
            "judged": (("training", "window"), [[True]]),
            "training_std": (("training", "channel"), [[8.0, 0.5]]),
            "lower": (("ensemble", *dims), lower[None]),
            "upper": (("ensemble", *dims), upper[None]),
            "error": (("model", "measure", "training", "window", "channel"), [errors]),
        },
        coords={
            "channel": ["heave", "load"],
            "time": time,
            "model": ["m"],
            "ensemble": ["m"],
            "measure": list(MEASURES),
        },
    )
    names = {"units": ["m", "N"], "long_name": ["heave", "load"]}
    settings = {"tests": {"t": {"label": "sea"}}, "statistics": {"level": 0.95}}
    groups = {
        "channels": xr.Dataset(
            {key: ("name", words) for key, words in names.items()},
            coords={"name": ["heave", "load"], "channel": ["heave", "load"]},
        ),
        "tests/t": test,
        "statistics/boxes": box_table(test).expand_dims(test=["t"]),
        "statistics/bands": band_parts(test, None, 0.95).expand_dims(test=["t"]),
    }
    models = {"m": {"ensemble": True}}
    attrs = {"settings": json.dumps(settings), "models": json.dumps(models)}
    return StudyResult(None, attrs, groups)


def test_errors_stand_in_both_standard_deviations(result):
    (table,) = scales(result).tables
    heave, load, average = table.rows
    assert heave == ("heave", "0.25", "0.300 (0.075)")
    assert load == ("load", "0.00", "– (1.525)")
    assert average == ("average", "", "0.300 (0.800)")


def test_bands_stand_by_horizon_and_channel(result):
    parts, channels = bands(result).tables
    inside = {row[1]: row[2:4] for row in parts.rows}
    assert inside["all"] == ("0.83", "0.67 (heave)")
    assert inside["first third"] == ("0.50", "0.00 (heave)")
    assert inside["last third"] == ("1.00", "1.00 (heave)")
    heave = {row[1]: row for row in channels.rows}["heave [m]"]
    width = (4 * 1.0 + 8 * 20.0) / 12
    assert heave[3] == f"{width / 2:.2f}"
    # 2/0.05 times the distance to the bound at -9, of crests and troughs in turn, in a third.
    assert float(heave[4]) == pytest.approx(width + 40 * 9 / 3, rel=4e-3)  # three digits


def test_a_study_without_ensembles_shows_no_bands(result):
    models = json.dumps({"m": {"ensemble": False}})
    attrs = {**result.attrs, "models": models}
    assert bands(StudyResult(None, attrs, result.groups)) is None


def test_choices_stand_with_the_look_ahead(result):
    tried = "ridge 0.001: the best\n  0.3 ridge 0.001, observables none"
    group = xr.Dataset(
        {"words": ("training", [tried, ""]), "look_ahead": ("training", [1.5, 0.0])},
        coords={"training": ["a", "b"]},
    ).expand_dims(model=["m"])
    known = StudyResult(None, result.attrs, {**result.groups, "chosen": group})
    (table,) = chosen(known).tables
    words = "ridge 0.001: the best; 0.3 ridge 0.001, observables none"
    assert table.rows == [("m", "a", "1.50", words)]
    nothing = {**result.groups, "chosen": group.isel(training=[1])}
    assert chosen(StudyResult(None, result.attrs, nothing)) is None
