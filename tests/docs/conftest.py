"""The tutorial's folder, where pages are played."""

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def tutorial(tmp_path, monkeypatch):
    """A copy of it, where the commands of a page run."""
    folder = tmp_path / "tutorial"
    shutil.copytree(Path(__file__).parents[2] / "docs/tutorial", folder)
    monkeypatch.chdir(folder)
    return folder
