"""A small study on the tutorial's campaign: seconds, and all of its parts."""

from collections.abc import Callable
from pathlib import Path

import pytest
from tutorial_study import put_tutorial

STUDY = """
[study]
campaign = "campaign.toml"
preset = "recommended"
seed = 3

[training]
windows = 2

[models.deterministic]
ridge = 0.15
observables = []
readouts = {}

[models.bayesian]
kind = "bayesian_hankel_dmdc"
n_members = 4
ridge = { log_uniform = [0.05, 0.5] }
observables = []
readouts = {}
window = { uniform = ["10 T", "20 T"] }

[tests.unseen]
runs = ["unseen"]
windows = 3
length = 6

[statistics]
n_series = 8
"""


@pytest.fixture(scope="session")
def put_study() -> Callable[[Path], str]:
    """Put the tutorial's campaign and a study of it into a folder; gives the study's text."""

    def put(folder: Path) -> str:
        put_tutorial(folder, STUDY)
        return STUDY

    return put


@pytest.fixture
def study_folder(tmp_path: Path, put_study: Callable[[Path], str]) -> Path:
    """A folder with the tutorial's campaign and a study of it."""
    put_study(tmp_path)
    return tmp_path
