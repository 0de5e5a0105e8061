"""A study of one's own on the tutorial's campaign."""

import shutil
from pathlib import Path

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial"


def put_tutorial(folder: Path, study: str) -> None:
    """Put the tutorial's campaign and a study of it into a folder."""
    for path in TUTORIAL.glob("*"):
        if path.suffix in (".toml", ".csv"):
            shutil.copy(path, folder)
    (folder / "study.toml").write_text(study, encoding="utf-8")
