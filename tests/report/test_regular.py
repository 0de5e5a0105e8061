"""The table on regular waves says what of the error is offset, amplitude and phase."""

import json

import numpy as np
import pytest
import xarray as xr

from seakeep.report.sections.errors import regular
from seakeep.study import StudyResult


def result(offset, wave=0.3, rest=0.1, slack=0.0):
    """A study of one model in regular waves of two lengths."""
    names = ["surge", "mooring_stern"]
    parts = {"error_offset": offset, "error_wave": wave, "error_rest": rest}
    parts |= {"amplitude_ratio": 0.9, "phase_lead": -5.0}
    response = xr.Dataset(
        {key: (("model", "channel"), [[value, value]]) for key, value in parts.items()},
        coords={"model": ["m"], "channel": names},
    )
    runs = xr.Dataset(
        {"slack": (("run", "name"), [[np.nan, slack], [np.nan, 0.0]])},
        coords={"run": ["short", "long"], "name": names},
    )
    settings = {"tests": {"short": {"label": "regular, λ/L 1.5"}, "long": {"label": ""}}}
    groups = {
        "channels": xr.Dataset(
            {
                "long_name": ("name", ["surge", "stern mooring load"]),
                "channel": ("channel", names),
            },
            coords={"name": names},
        ),
        "runs": runs,
    }
    groups["statistics/response"] = response.expand_dims(test=[*settings["tests"]])
    for name in settings["tests"]:
        groups[f"tests/{name}"] = xr.Dataset({"run": ("window", [name])}, coords={"channel": names})
    models = {"m": {"kind": "hankel_dmdc", "ensemble": False}}
    attrs = {"settings": json.dumps(settings), "models": json.dumps(models)}
    return StudyResult(None, attrs, groups)


def test_one_table_holds_all_waves_side_by_side():
    (table,) = regular(result(0.4)).tables
    assert table.columns[2:6] == (
        "λ/L 1.5: amplitude", "λ/L 1.5: phase [°]", "λ/L 1.5: offset [SD]", "λ/L 1.5: share"
    )  # fmt: skip
    # 0.16 of 0.16 + 0.09 + 0.01 of the mean square is the offset's.
    assert table.rows[0] == ("surge", "m", *("0.90", "-5", "0.40", "62 %") * 2)


@pytest.mark.parametrize(("part", "told"), [(0.0, False), (0.512, True)])
def test_a_slack_line_is_named_with_its_share(part, told):
    words = regular(result(0.4, slack=part)).words
    assert len(words) == told
    if told:
        assert "stern mooring load in 51 % of short." in words[0]


def test_a_forecast_without_error_has_no_share_of_it():
    (table,) = regular(result(0.0, wave=0.0, rest=0.0)).tables
    assert table.rows[0][5] == "–"
