"""Fixtures: the small tank's folder, and its campaign file with texts replaced."""

import pytest
from small_tank import CAMPAIGN, tank_columns, write_csv
from tutorial_study import edit

from seakeep import read_campaign


@pytest.fixture
def tank(tmp_path):
    """Folder with ``first.csv`` and ``second.csv``."""
    for seed, name in enumerate(("first", "second")):
        write_csv(tmp_path / f"{name}.csv", tank_columns(seed))
    return tmp_path


@pytest.fixture
def edited(tank):
    """Write the campaign file with texts replaced; return its path."""

    def write(*pairs):
        (tank / "campaign.toml").write_text(CAMPAIGN, "utf-8")
        return edit(tank / "campaign.toml", *pairs)

    return write


@pytest.fixture
def changed(edited):
    """A campaign with texts of its file replaced."""
    return lambda *pairs: read_campaign(edited(*pairs))


@pytest.fixture
def first(changed):
    """The first run of such a campaign, prepared."""
    return lambda *pairs: changed(*pairs).prepare(["first"])["first"]
