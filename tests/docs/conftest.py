"""The tutorial's folder, where pages are played."""

import shutil

import pytest
from places import ROOT


@pytest.fixture
def tutorial(tmp_path, monkeypatch):
    """A copy of it, where the commands of a page run."""
    folder = tmp_path / "tutorial"
    shutil.copytree(ROOT / "docs/tutorial", folder)
    monkeypatch.chdir(folder)
    return folder
