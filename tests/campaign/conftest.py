"""Fixtures: the small tank's folder, and its campaign file with texts replaced."""

from pathlib import Path

import pytest
from small_tank import CAMPAIGN, tank_columns, write_csv


@pytest.fixture
def tank(tmp_path):
    """Folder with ``first.csv``, ``second.csv`` and ``campaign.toml``."""
    for seed, name in enumerate(("first", "second")):
        write_csv(tmp_path / f"{name}.csv", tank_columns(seed))
    (tmp_path / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    return tmp_path


@pytest.fixture
def edited(tank):
    """Write the campaign file with texts replaced; return its path."""

    def write(*pairs: tuple[str, str]) -> Path:
        text = CAMPAIGN
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new, 1)
        path = tank / "campaign.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write
