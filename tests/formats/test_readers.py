"""How a reader is found and added, and what paths are read."""

import os

import numpy as np
import pandas as pd
import pytest

from seakeep.campaign import read_campaign, read_table
from seakeep.errors import MissingFileError
from seakeep.formats import Columns


def test_each_file_is_parsed_once_in_a_preparation(tmp_path, monkeypatch):
    """Although the encounter period is measured on all runs before the first is prepared."""
    parsed, read_csv = [], pd.read_csv
    monkeypatch.setattr(pd, "read_csv", lambda *a, **k: parsed.append(1) or read_csv(*a, **k))
    t = 0.1 * np.arange(400)
    for name in "ab":
        table = pd.DataFrame({"t [s]": t, "eta_1 [m]": np.sin(t), "heave [m]": np.cos(t)})
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    runs = "".join(f"[runs.{name}]\nfile = '{name}.csv'\n" for name in "ab")
    (tmp_path / "campaign.toml").write_text(
        f"[channels.eta_1]\n[channels.heave]\n{runs}[preparation]\nsteps_per_period = 32\n"
    )
    assert len(read_campaign(tmp_path / "campaign.toml").prepare()) == 2
    assert len(parsed) == 2


def test_columns_are_found_by_name_or_header():
    table = Columns({"heave": np.zeros(2)}, headers={"heave": "heave [mm]"})
    assert table.find("heave [mm]") == table.find("heave") == "heave"
    assert table.find("pitch") is None


class TestPaths:
    """Whatever a path names, the error says it with its reason."""

    def refused(self, path, reason):
        with pytest.raises(MissingFileError, match=reason):
            read_table(path)

    def test_a_home_that_is_unknown(self):
        self.refused("~nobody-of-this-name/run.csv", "cannot be read: Could not determine home")

    def test_a_file_in_the_place_of_a_folder(self, tmp_path):
        (tmp_path / "run.csv").write_text("t,h\n")
        self.refused(tmp_path / "run.csv" / "more.csv", "does not exist: there is no folder")

    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFO")
    def test_a_pipe(self, tmp_path):
        os.mkfifo(tmp_path / "pipe.csv")
        self.refused(tmp_path / "pipe.csv", r"pipe\.csv is a pipe or a device, and only regular")
