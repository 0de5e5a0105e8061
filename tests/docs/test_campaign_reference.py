"""The page of the campaign file says what the settings say."""

import importlib.util
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_is_up_to_date():
    place = DOCS / "make_campaign_reference.py"
    spec = importlib.util.spec_from_file_location("make_campaign_reference", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    written = (DOCS / "campaign_file.md").read_text(encoding="utf-8")
    assert written == module.page(), "run python docs/make_campaign_reference.py"
