"""A study file says what it wants, and what it cannot say is told key by key."""

import pytest

from seakeep.errors import RequestError
from seakeep.study import read_study
from seakeep.study.plan import windows_overlap
from seakeep.study.settings import StudySettings
from seakeep.toml import validated


def test_what_is_left_out_is_the_papers():
    settings = validated(
        StudySettings, {"study": {"campaign": "campaign.toml"}}, "study.toml", "study"
    )
    assert settings.study.preset == "paper"
    assert {n: m.kind for n, m in settings.models.items()} == {
        "deterministic": "hankel_dmdc",
        "bayesian": "bayesian_hankel_dmdc",
    }
    assert list(settings.tests) == ["irregular"]


@pytest.mark.parametrize(
    ("words", "tables"),
    {
        "training.window: unknown key, received 3. Did you mean 'w": {"training": {"window": 3}},
        r"^study.toml: 2 mistakes(.|\n)*training.windows: received 0(.|\n)*length: received -1":
            {"training": {"windows": 0}, "tests": {"irregular": {"length": -1.0}}},
        "'windows' belongs to scheme = 'hal": {"training": {"scheme": "leave_out", "windows": 3}},
        "'leave_out' belongs to scheme = 'leave_out'": {"training": {"leave_out": "run"}},
        r"densities_of = 'regular' is not a table": {"statistics": {"densities_of": "regular"}},
        "the name 'a/b' must hold a letter or digit, and nothing beside": {"tests": {"a/b": {}}},
        "the name '_-' must hold a letter or digit": {"tests": {"_-": {}}},
        r"seed: received 18446.* below 2\^64": {"study": {"campaign": "c.toml", "seed": 2**64}},
    }.items(),
)  # fmt: skip
def test_what_no_study_file_may_say(tables, words):
    content = {"study": {"campaign": "campaign.toml"}, **tables}
    with pytest.raises(RequestError, match=words):
        validated(StudySettings, content, "study.toml", "study")


def test_the_digest_follows_settings_and_raw_files_and_no_words(study_folder):
    path = study_folder / "study.toml"
    text = path.read_text("utf-8")

    def digest(seed="seed = 3", more=""):
        path.write_text(text.replace("seed = 3", seed) + more, "utf-8")
        return read_study(path).digest

    before = digest()
    assert digest('seed = 3\nname = "other"', "\n[output]\npaper = true\n") == before
    assert digest("seed = 4") != before
    with (study_folder / "run2.csv").open("a", encoding="utf-8") as file:
        file.write("\n")
    assert digest() != before


def test_overlap_of_windows_by_hand():
    # b is half covered by a, a is half covered by b, c lies in another run.
    spans = [("x", 0.0, 10.0), ("x", 5.0, 15.0), ("y", 0.0, 10.0)]
    # 200 cells a window: the share is exact to one cell.
    assert windows_overlap(spans) == pytest.approx(1 / 3, abs=0.005)
