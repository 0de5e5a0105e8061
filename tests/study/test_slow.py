"""The commands tell where training windows hold too few periods of a slow motion."""

import numpy as np
import pandas as pd
import pytest

from seakeep import SeakeepWarning
from seakeep.study import read_study, run_study
from seakeep.study.plan import make_plan, warn_of_slow_study

DRIFT = 60.0
"""Period of the drift put onto heave, s: the two training runs hold four periods in all."""


def test_a_study_with_short_windows_is_told_once(study_folder, monkeypatch):
    """The tutorial's runs, their heave on a slow drift three times as large as the waves."""
    for path in study_folder.glob("*.csv"):
        table = pd.read_csv(path, sep=";")
        time, heave = table.iloc[:, 0], table.filter(like="HEAVE").columns
        size = 3 * np.sqrt(2) * table[heave].std()
        table[heave] += np.outer(np.sin(2 * np.pi * time / DRIFT), size)
        table.to_csv(path, sep=";", index=False, float_format="%.6g")
    study = read_study(study_folder / "study.toml")
    plan = make_plan(study)
    with pytest.warns(SeakeepWarning, match=r"slow motion of heave \(period [56]\d") as caught:
        warn_of_slow_study(plan)
    assert len(caught) == 1
    assert "windows of 'bayesian' in" in str(caught[0].message)  # 20 T at most
    monkeypatch.setattr("seakeep.study.run._computed", lambda *_: pytest.fail("told before"))
    with pytest.warns(SeakeepWarning, match="slow motion"), pytest.raises(pytest.fail.Exception):
        run_study(study, study_folder / "out")
