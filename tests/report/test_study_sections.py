"""Sections of a study whose numbers can be worked out by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from cells import cells

from seakeep.report.sections.data import chosen, not_chosen, unequal_look_ahead
from seakeep.report.sections.results import (
    bands,
    conditional,
    difference_table,
    of_judged,
    regular,
    scales,
)
from seakeep.study import StudyResult
from seakeep.study.judge import band_tables, box_table


@pytest.fixture
def result():
    """An ensemble in one window of two channels: a wave of SD 2, and a load that stands still."""
    time, names = np.arange(1, 13), ["heave", "load"]
    wave = np.where(time % 2, 2.0, -2.0) * np.sqrt(11 / 12)  # SD 2 with ddof = 1
    measured = np.stack([wave, np.full(12, 5.0)], axis=1)[None]
    lower, upper = np.full((1, 1, 12, 2), -10.0), np.full((1, 1, 12, 2), 10.0)
    upper[..., :4, 0] = -9.0  # the first third of the horizon misses the wave
    errors = [[[[0.3, np.nan]]], [[[0.3, np.nan]]], [[[0.075, 1.525]]]]
    test = cells(
        names, time, measured=measured, judged=[[True]], training_std=[[8.0, 0.5]],
        lower=lower[None], upper=upper[None], error=[errors], run=["short"],
    )  # fmt: skip
    settings = {"tests": {"t": {"label": "regular, {λ/L} 1.5"}}, "statistics": {"level": 0.95}}
    channels = xr.Dataset(
        {"units": ("name", ["m", "N"]), "long_name": ("name", ["heave", "stern line"])},
        coords={"name": names, "channel": names},
    )
    groups = {
        "channels": channels,
        "runs": xr.Dataset({"slack": (("run", "name"), [[np.nan, 0.512]])})
        .assign_coords(run=["short"], name=names),
        "tests/t": test,
        "statistics/boxes": box_table(test).expand_dims(test=["t"]),
        "statistics/bands": band_tables(test, None, 0.95)["bands"].expand_dims(test=["t"]),
    }  # fmt: skip
    return StudyResult(None, {"settings": json.dumps(settings), "models": models_of(m={})}, groups)


def models_of(**models):
    """Models as a result holds them: ensembles without stated settings, unless said."""
    return json.dumps(
        {name: {"ensemble": True, "settings": {}, **each} for name, each in models.items()}
    )


def with_models(result, **models):
    return replace(result, attrs={**result.attrs, "models": models_of(**models)})


def with_group(result, name, group):
    return replace(result, groups={**result.groups, name: group})


def with_choices(result, words, look_ahead):
    """Models "m" and "fir" of training sets "a" and "b"."""
    over = ("model", "training")
    group = xr.Dataset(
        {"words": (over, words), "look_ahead": (over, look_ahead)},
        coords={"model": ["m", "fir"], "training": ["a", "b"]},
    )
    return with_group(with_models(result, m={}, fir={"role": "reference"}), "chosen", group)


@pytest.mark.parametrize(
    ("ahead", "words"),
    [
        ([[1.17, 0.59], [0.0, 0.0]], "different times: m 0.59 to 1.17 s; FIR 0.00 s. Part"),
        ([[1.17, 1.17], [1.17, 1.17]], ""),
    ],
)
def test_models_that_know_more_of_the_waves_are_named(result, ahead, words):
    said = unequal_look_ahead(with_choices(result, [["", ""]] * 2, ahead))
    assert words in said
    assert bool(said) == bool(words)


def test_settings_that_nothing_was_held_out_to_choose_are_named(result):
    fallen = "ridge 0.001: no window of 480 samples can be held out of runs of at most 400"
    found = with_choices(result, [[fallen, "chosen"], [fallen, fallen]], np.zeros((2, 2)))
    assert "to be held out: m in a; FIR in a, b; see “How settings were" in not_chosen(found)
    assert not_chosen(with_choices(result, [["", "chosen"]] * 2, np.zeros((2, 2)))) == ""


def test_models_that_read_the_measured_surge_are_named_where_they_are_shown(result):
    reading = {
        "alignment.surge": {"value": "measured"},
        "alignment.surge_channel": {"value": "x_0"},
    }
    found = with_models(
        result,
        paper={"settings": reading},
        m={"settings": {**reading, "alignment.surge": {"value": "predicted"}}},
        own={},
        hold_last={"role": "reference"},
    )
    assert found.conditional_on == {"paper": "x_0"}
    assert conditional(found, found.models) == " Conditional on measured x 0: paper."
    assert conditional(found, ["m", "own"]) == ""
    assert of_judged(found) == (
        " References are left out: hold last; see “Errors in SD of the training”. "
        "Conditional on measured x 0: paper."
    )
    assert of_judged(result) == ""


def test_the_difference_from_the_first_model_has_a_table(result):
    numbers = {"change": [-0.2, 1.5], "lower": [-0.3, np.nan], "upper": [-0.1, np.nan]}
    models = ["m", "fir"]
    table = (
        xr.Dataset({key: ("measure", each) for key, each in numbers.items()})
        .assign_coords(measure=["nrmse", "nammae"])
        .expand_dims(test=["t"], model=models, other=models, channel=["average"])
        .copy(deep=True)
    )
    table["change"].loc[{"model": "m"}] = 9.0  # the other way round
    found = with_group(with_models(result, m={}, fir={}), "statistics/differences", table)
    shown = difference_table(found, "t")
    assert shown.name == "differences_t"
    assert shown.rows == [
        ("FIR", "−20 %", "−30 to −10 %", "better", "2.5 times", "–", "cannot tell")
    ]
    assert "from m to each other model" in shown.note


def test_errors_stand_in_both_standard_deviations(result):
    (table,) = scales(result).tables
    assert table.rows == [
        ("heave", "0.25", "0.300 (0.075)"),
        ("stern line", "0.00", "– (1.525)"),
        ("average", "", "0.300 (0.800)"),
    ]


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
    assert bands(with_models(result, m={"ensemble": False})).is_empty


@pytest.mark.parametrize(("size", "share"), [(1.0, "62 %"), (0.0, "–")])
def test_errors_in_regular_waves_are_taken_apart_and_a_slack_line_is_named(result, size, share):
    # 0.16 of 0.16 + 0.09 + 0.01 of the mean square is the offset's; without an error, of nothing.
    parts = {"error_offset": 0.4, "error_wave": 0.3, "error_rest": 0.1}
    values = {key: size * part for key, part in parts.items()}
    values |= {"amplitude_ratio": 0.9, "phase_lead": -5.0}
    response = xr.Dataset(
        {key: (("test", "model", "channel"), np.full((1, 1, 2), x)) for key, x in values.items()},
        coords={"test": ["t"], "model": ["m"], "channel": result.channels},
    )
    section = regular(with_group(result, "statistics/response", response))
    (table,) = section.tables
    assert table.columns[2:] == [
        f"{{λ/L}} 1.5: {part}" for part in ("amplitude", "phase [°]", "offset [SD]", "share")
    ]
    assert table.rows[0] == ("heave", "m", "0.90", "-5", f"{0.4 * size:.2f}", share)
    assert "stern line in 51 % of short." in section.words[0]


def test_choices_stand_with_the_look_ahead(result):
    tried = "ridge 0.001: the best\n  0.3 ridge 0.001, observables none"
    group = xr.Dataset(
        {"words": ("training", [tried, ""]), "look_ahead": ("training", [1.5, 0.0])},
        coords={"training": ["a", "b"]},
    ).expand_dims(model=["m"])
    (table,) = chosen(with_group(result, "chosen", group)).tables
    words = "ridge 0.001: the best; 0.3 ridge 0.001, observables none"
    assert table.rows == [("m", "a", "1.50", words)]
    assert chosen(with_group(result, "chosen", group.isel(training=[1]))).is_empty
