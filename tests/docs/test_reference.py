"""The pages of the campaign file and of the study file say what the settings say."""

import pytest
from loaded import loaded
from places import ROOT

DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def module():
    return loaded(DOCS / "make_reference.py")


@pytest.mark.parametrize("name", ["campaign_file.md", "study.md"])
def test_the_page_is_up_to_date(name, module):
    written = (DOCS / name).read_text("utf-8")
    assert module.keys_of(module.StudySettings)
    assert written == module.PAGES[name](), "run python docs/make_reference.py"


def test_commands_and_public_names_have_their_places(module):
    pages = dict(module.generated())
    commands = pages["commands.md"]
    assert "## seakeep datasets fetch" in commands
    assert "| `--run TEXT` | Name of a run (repeatable); by default the test runs. |" in commands
    assert "seakeep compare model.nc docs/tutorial/campaign.toml -o comparison\n```" in commands
    assert "](api/seakeep.HankelDMDc.md): Settings of a Hankel" in pages["api.md"]
    # An object is in the first room that names it, and nowhere else.
    assert "api/seakeep.models.HankelDMDc.md" not in pages
    assert "autoclass:: seakeep.HankelDMDc\n   :members:" in pages["api/seakeep.HankelDMDc.md"]
    assert "autoexception:: seakeep.DataError" in pages["api/seakeep.DataError.md"]
