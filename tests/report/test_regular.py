"""The words on regular waves claim no more than their numbers."""

import json

import numpy as np
import xarray as xr

from seakeep.report.sections.regular import response_words
from seakeep.study import StudyResult


def result(offsets, shift=2.0, ratio=0.5, slack=0.0):
    """A study of one test set; falling back to the training mean makes shift / ratio SDs."""
    names = ["surge", "mooring_stern"]
    each = {"sd_ratio": ratio, "mean_shift": shift}
    parts = {"error_wave": 0.3, "error_rest": 0.1, "amplitude_ratio": 0.9, "phase_lead": 5.0}
    response = xr.Dataset(
        {
            **{key: ("channel", [value, value]) for key, value in each.items()},
            **{key: (("model", "channel"), [[value, value]]) for key, value in parts.items()},
            "error_offset": (("model", "channel"), [list(offsets)]),
            "celerity": ("model", [np.nan]),
            "celerity_phase": ("model", [np.nan]),
        },
        coords={"model": ["m"], "channel": names},
        attrs={"frequency": 0.86, "energy_share": 0.2, "height_ratio": 0.95, "surge_shift": 0.0},
    )
    runs = xr.Dataset(
        {"slack": (("run", "name"), [[np.nan, slack]])}, coords={"run": ["wave"], "name": names}
    )
    test = xr.Dataset({"run": ("window", ["wave"])}, coords={"channel": names})
    settings = {"tests": {"t": {"label": ""}}}
    groups = {
        "channels": xr.Dataset(
            {"long_name": ("name", ["surge", "stern mooring load"])},
            coords={"channel": names, "name": names},
        ),
        "statistics/response/t": response,
        "runs": runs,
        "tests/t": test,
    }
    return StudyResult(None, {"settings": json.dumps(settings), "models": '{"m": {}}'}, groups)


def words(*arguments, **keywords):
    return response_words(result(*arguments, **keywords), "t")


def test_an_offset_of_the_size_of_a_fall_back_is_explained_by_it():
    said = words((4.4, 3.0))  # 4 SD expected: factors 1.1 and 1.33
    assert "accounts for the offset within a factor of 1.5" in said
    assert "does not account" not in said


def test_an_offset_of_another_size_is_not_explained():
    said = words((4.4, 1.3))  # a factor of 3 below what a fall-back makes
    assert "accounts for the offset in surge within a factor of 1.5" in said
    assert "in measured SDs, of 4.0 in stern mooring load: that does not account" in said
    alone = words((10.0, 1.3))
    assert "steady drift" not in alone
    assert "of 4.0 in surge, 4.0 in stern mooring load: that does not account" in alone


def test_a_slack_line_is_named_with_its_share():
    assert "Slack line: stern mooring load in 51 %" in words((4.4, 3.0), slack=0.512)
    assert "lack line" not in words((4.4, 3.0), slack=0.0)


def test_heights_are_said_to_be_heights():
    assert "0.95 times as high (heights counted as 4 standard deviations of the" in words(
        (0.1, 0.1)
    )
