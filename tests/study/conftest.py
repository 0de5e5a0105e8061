"""A small study on the tutorial's campaign: seconds, and all of its parts."""

import shutil
from pathlib import Path

import pytest

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial"

STUDY = """
[study]
campaign = "campaign.toml"
preset = "recommended"
seed = 3

[training]
windows = 2

[models.deterministic]
ridge = 0.15

[models.bayesian]
kind = "bayesian_hankel_dmdc"
n_members = 4
train_length = { uniform = [10, 20] }

[tests.unseen]
runs = ["unseen"]
windows = 3
length = 6

[statistics]
n_series = 8
"""


@pytest.fixture
def study_folder(tmp_path: Path) -> Path:
    """A folder with the tutorial's campaign and a study of it."""
    for path in TUTORIAL.glob("*"):
        if path.suffix in (".toml", ".csv"):
            shutil.copy(path, tmp_path)
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    return tmp_path
