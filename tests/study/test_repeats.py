"""A study says by itself where its tests repeat what its models learnt from."""

import pytest

from seakeep.errors import SeakeepWarning
from seakeep.study import read_study
from seakeep.study.describe import describe_study, words_of_repeats
from seakeep.study.plan import make_plan


def groups(folder):
    study = read_study(folder / "study.toml")
    return describe_study(study, make_plan(study))


def test_a_run_that_was_learnt_from_is_found_and_named(study_folder):
    files = sorted(study_folder.glob("*.csv"))
    files[-1].write_bytes(files[0].read_bytes())  # the test run is a training run
    with pytest.warns(SeakeepWarning, match="^unseen: file is one of first too"):
        found = groups(study_folder)["repeats"]
    assert list(found["run"].values) == ["unseen"]
    assert found["share"].item() > 0.5  # as far as the last of two random windows reaches
    assert found["correlation"].item() == pytest.approx(1.0, abs=1e-3)
    words = words_of_repeats(found)
    assert words.startswith("The input 'eta_fwd' of unseen repeats training input: ")
    assert words.endswith(
        "turned by 0 degrees (correlation 1.000). Tests there show memory, not skill."
    )


def test_seas_of_their_own_repeat_nothing(study_folder):
    assert "repeats" not in groups(study_folder)
