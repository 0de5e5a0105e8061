"""The pages of the campaign file and of the study file say what the settings say."""

import importlib.util
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("name", ["campaign_file.md", "study.md"])
def test_the_page_is_up_to_date(name):
    place = DOCS / "make_reference.py"
    spec = importlib.util.spec_from_file_location("make_reference", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    written = (DOCS / name).read_text(encoding="utf-8")
    assert module.keys_of(module.StudySettings)
    assert written == module.PAGES[name](), "run python docs/make_reference.py"
