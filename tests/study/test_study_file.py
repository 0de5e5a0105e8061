"""A study file says what it wants, and what it cannot say is told key by key."""

import pytest

from seakeep.errors import RequestError
from seakeep.study import read_study
from seakeep.study.plan import windows_overlap
from seakeep.study.settings import StudySettings
from seakeep.toml import validated


def refused(**tables):
    content = {"study": {"campaign": "campaign.toml"}, **tables}
    with pytest.raises(RequestError) as caught:
        validated(StudySettings, content, "study.toml", "study")
    return str(caught.value)


def test_what_is_left_out_is_the_papers():
    settings = validated(
        StudySettings, {"study": {"campaign": "campaign.toml"}}, "study.toml", "study"
    )
    assert settings.study.preset == "paper"
    assert settings.training.windows == 10
    assert {n: m.kind for n, m in settings.models.items()} == {
        "deterministic": "hankel_dmdc",
        "bayesian": "bayesian_hankel_dmdc",
    }
    assert settings.tests["irregular"].windows == 10
    assert settings.tests["irregular"].length == 15
    assert settings.statistics.n_series == 100


def test_an_unknown_key_is_answered_with_the_nearest():
    message = refused(training={"window": 3})
    assert "training.window: unknown key, received 3. Did you mean 'windows'?" in message


def test_all_mistakes_are_told_at_once():
    message = refused(training={"windows": 0}, tests={"irregular": {"length": -1.0}})
    assert message.startswith("study.toml: 2 mistakes in the study file")
    assert "training.windows: received 0" in message
    assert "tests.irregular.length: received -1.0" in message


def test_a_key_of_another_scheme_is_refused():
    assert "'windows' belongs to scheme = 'halves'" in refused(
        training={"scheme": "leave_out", "windows": 3}
    )


def test_densities_of_an_unknown_test_set_are_refused():
    assert "statistics.densities_of = 'regular' is not a table of [tests]" in refused(
        statistics={"densities_of": "regular"}
    )


def test_a_run_that_the_campaign_does_not_have(study_folder):
    path = study_folder / "study.toml"
    path.write_text(path.read_text("utf-8").replace('["unseen"]', '["unseeen"]'), "utf-8")
    with pytest.raises(RequestError, match=r"no such run. Did you mean 'unseen'"):
        read_study(path)


def test_a_channel_that_the_campaign_does_not_have(study_folder):
    path = study_folder / "study.toml"
    text = path.read_text("utf-8").replace(
        "seed = 3", 'seed = 3\nstates = ["heave", "sway"]\ninputs = ["eta_fwd"]'
    )
    path.write_text(text, "utf-8")
    with pytest.raises(RequestError, match=r"study.states: received 'sway'.*no such channel"):
        read_study(path)


def test_the_digest_follows_settings_and_not_words(study_folder):
    path = study_folder / "study.toml"
    text = path.read_text("utf-8")
    before = read_study(path).digest
    path.write_text(text.replace("seed = 3", 'seed = 3\nname = "other"'), "utf-8")
    assert read_study(path).digest == before
    path.write_text(f"{text}\n[output]\npaper = true\n", "utf-8")
    assert read_study(path).digest == before
    path.write_text(text.replace("seed = 3", "seed = 4"), "utf-8")
    assert read_study(path).digest != before


def test_the_digest_follows_the_raw_files(study_folder):
    before = read_study(study_folder / "study.toml").digest
    with (study_folder / "run2.csv").open("a", encoding="utf-8") as file:
        file.write("\n")
    assert read_study(study_folder / "study.toml").digest != before


def test_overlap_of_windows_by_hand():
    # b is half covered by a, a is half covered by b, c lies in another run.
    spans = [("x", 0.0, 10.0), ("x", 5.0, 15.0), ("y", 0.0, 10.0)]
    # 200 cells a window: the share is exact to one cell.
    assert windows_overlap(spans) == pytest.approx(1 / 3, abs=0.005)


def test_a_seed_that_no_file_can_hold_is_refused_before_the_work():
    refused_seed = {"study": {"campaign": "campaign.toml", "seed": 2**64}}
    with pytest.raises(RequestError, match=r"study.seed: received 18446.* below 2\^64"):
        validated(StudySettings, refused_seed, "study.toml", "study")
