"""The page of the measurement chain runs and prints what it shows; what it names exists."""

import importlib
import re
from pathlib import Path

import pytest
from pages import play

from seakeep import signals
from seakeep.campaign.settings import (
    DerivedSettings,
    GeneralSettings,
    InstrumentSettings,
    PreparationSettings,
    RigSettings,
    RunSettings,
)

PAGE = (Path(__file__).parents[2] / "docs/measurement_chain.md").read_text(encoding="utf-8")


@pytest.mark.usefixtures("empty_sheet")
def test_the_page_runs_and_prints_what_it_shows(tmp_path, monkeypatch):
    pytest.importorskip("numba", reason="the page plays the tank")
    monkeypatch.chdir(tmp_path)
    play(PAGE, "measurement_chain.md")
    sheet = (tmp_path / "virtual/prepared/quality.html").read_text(encoding="utf-8")
    assert re.search(r"<td>regular_<wbr>2</td><td[^>]*>not prepared</td>", sheet)


def test_functions_and_keys_of_the_table_exist():
    table = PAGE[PAGE.index("| step |") : PAGE.index("Three things follow")]
    rows = [line.split("|")[1:-1] for line in table.splitlines()[2:] if line.startswith("|")]
    assert len(rows) > 12
    models = (
        *(DerivedSettings, InstrumentSettings, PreparationSettings),
        *(GeneralSettings, RigSettings, RunSettings),
    )
    keys = {key for model in models for key in model.model_fields} | {"alignment"}
    steps = {
        "low_pass",
        "integrate",
        "complementary_filter",
        "differentiate",
        "transfer",
        "remove_gravity",
    }
    for _, functions, toml, _ in rows:
        for name in re.findall(r"`([a-z_.0-9]+)`", functions):
            module, _, last = name.rpartition(".")
            if not module.startswith("seakeep"):
                module = f"seakeep.signals.{module}".rstrip(".")
            assert callable(getattr(importlib.import_module(module), last)), name
        for key in re.findall(r"`([a-z_]+)`", toml):
            assert key in keys, key
        assert set(re.findall(r'"([a-z_]+)"', toml)) <= steps
    assert set(signals.__all__) >= {"low_pass", "track_video"}
