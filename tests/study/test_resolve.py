"""From the table of a model to its settings: as stated, else the preset's, else the default."""

import json

import pytest

from seakeep.campaign import ModelSettings
from seakeep.study.resolve import counts_in_periods, resolve_model

ENSEMBLE = "bayesian_hankel_dmdc"
NORMAL = {"distribution": "norm", "parameters": {"loc": 15, "scale": 1}, "unit": "T"}
READ = {"heave": "auto"}


@pytest.mark.parametrize(
    ("stated", "how", "expected"),
    [
        (
            {"preset": "paper", "ridge": 7.0},
            {},
            {
                "state_delays": (20, "preset"),
                "input_delays": (100, "preset"),
                "window": (400, "preset"),
                "ridge": (7.0, "stated"),
                "delay_rows": ("ridge", "default"),
                "alignment": (None, "default"),
            },
        ),
        ({"window": "inf T"}, {"preset": "paper"}, {"window": (None, "stated")}),
        (
            {"state_delays": 4, "input_delays": "1 T", "ridge": 1, "alignment": {"surge": "none"}},
            {"preset": "recommended"},
            {
                "state_delays": (4, "stated"),
                "input_delays": (20, "stated"),
                "ridge_scale": ("per_snapshot", "preset"),
                "alignment.surge": ("none", "stated"),
                "alignment.mode": ("dispersion", "preset"),
                "select.horizon": ([15.0, 45.0], "preset"),
                "rank": (None, "default"),
            },
        ),
        (
            {"select": {"horizon": ["5 T", 10]}},
            {"preset": "recommended", "folds": "sea_state"},
            {"select.horizon": ([5.0, 10.0], "stated"), "select.folds": ("sea_state", "study")},
        ),
        (
            {"select": {"folds": "run", "horizon": "15 T"}},
            {"preset": "recommended", "folds": "sea_state"},
            {"select.horizon": ([15.0], "stated"), "select.folds": ("run", "stated")},
        ),
        (
            {"kind": "fir"},
            {"preset": "paper", "aligned": True},
            {"input_delays": (60, "preset"), "alignment.surge": ("measured", "preset")},
        ),
        (
            {"kind": "mean"},
            {"preset": "paper", "aligned": True, "folds": "run"},
            {"window": (None, "default")},
        ),
        (
            {"kind": ENSEMBLE, "n_members": 5, "ridge": {"log_uniform": [0.1, 10]},
             "state_delays": "0.5 T", "window": NORMAL},
            {"preset": "paper", "seed": 7},
            {
                "n_members": (5, "stated"),
                "ridge": ({"log_uniform": [0.1, 10.0]}, "stated"),
                "state_delays": (10, "stated"),
                "input_delays": ({"uniform": ["2.5 T", "7.5 T"]}, "preset"),
                "window": (NORMAL, "stated"),
                "seed": (7, "study"),
                "train_on": ("all", "default"),
            },
        ),
        (
            {"kind": ENSEMBLE, "readouts": READ},
            {"preset": "recommended"},
            {"readouts": (READ, "stated")},
        ),
    ],
)  # fmt: skip
def test_each_key_has_its_value_and_its_source(stated, how, expected):
    """With an encounter period of 2 s and steps of 0.1 s."""
    table = {"states": ("heave", "pitch"), "inputs": ("eta_fwd",), **stated}
    found = resolve_model(ModelSettings.model_validate(table), 2.0, 0.1, **how)
    told = json.loads(json.dumps(found.description))
    settings = told["settings"]
    assert {key: (settings[key]["value"], settings[key]["source"]) for key in expected} == expected
    assert told["n_members"] == stated.get("n_members", 100 if told["ensemble"] else 1)


@pytest.mark.parametrize(("centre", "counts"), {"run": True, "pooled": False, "2 T": True}.items())
def test_the_reference_period_of_each_run_counts_in_encounter_periods(centre, counts):
    own = {"state_delays": 4, "input_delays": 8, "ridge": 1.0, "centre": centre}
    table = {"states": ("heave",), "inputs": ("eta_fwd",), **own}
    assert counts_in_periods(ModelSettings.model_validate(table)) is counts
