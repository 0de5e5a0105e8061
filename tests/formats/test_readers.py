"""How a reader is found and added, and what paths are read."""

import os

import numpy as np
import pandas as pd
import pytest

from seakeep.campaign import read_campaign, read_table
from seakeep.errors import MissingFileError


def test_each_file_is_parsed_once_in_a_preparation(tmp_path, monkeypatch):
    """Although the encounter period is measured on all runs before the first is prepared."""
    parsed, read_csv = [], pd.read_csv
    monkeypatch.setattr(pd, "read_csv", lambda *a, **k: parsed.append(1) or read_csv(*a, **k))
    t = 0.1 * np.arange(400)
    for name in "ab":
        table = pd.DataFrame(
            {"t [s]": t, "eta_1 [m]": np.sin(t + ord(name)), "heave [m]": np.cos(t)}
        )
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    runs = "".join(f"[runs.{name}]\nfile = '{name}.csv'\n" for name in "ab")
    (tmp_path / "campaign.toml").write_text(
        f"[channels.eta_1]\n[channels.heave]\n{runs}[preparation]\nsteps_per_period = 32\n"
    )
    assert len(read_campaign(tmp_path / "campaign.toml").prepare()) == 2
    assert len(parsed) == 2


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFO")
def test_whatever_a_path_names_the_error_says_its_reason(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "run.csv").write_text("t,h\n")
    for name, reason in {
        "run.csv/more.csv": "does not exist: there is no folder",
        "pipe.csv": r"pipe\.csv is a pipe or a device, and only regular",
    }.items():
        with pytest.raises(MissingFileError, match=reason):
            read_table(tmp_path / name)
