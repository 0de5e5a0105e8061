"""Several instruments a run: the virtual tank's raw files through the measurement chain."""

import shutil

import numpy as np
import pytest

from seakeep.campaign import draft_campaign, read_campaign, write_prepared

pytest.importorskip("numba", reason="needs the extra tank")

RUNS = ("irregular_1", "regular_2")


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    from seakeep.tank.play import play
    from seakeep.tank.settings import default_settings

    folder = tmp_path_factory.mktemp("tank")
    play(default_settings(), folder, names=RUNS)
    return folder


@pytest.fixture
def copied(played, tmp_path):
    """A copy without the truth, and a writer of changed campaign files."""
    shutil.copytree(played, tmp_path / "tank", ignore=shutil.ignore_patterns("truth", "prepared"))

    def write(*pairs):
        path = tmp_path / "tank" / "campaign.toml"
        text = path.read_text()
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new, 1)
        path.write_text(text)
        return path

    return write


def test_interrupted_half_way_a_second_call_continues(copied):
    campaign = read_campaign(copied())
    folder = campaign.path.parent / "prepared"

    def stop(done, total, name):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_prepared(campaign, names=RUNS, progress=stop)
    # Each run is written before the next one is begun, and nothing half done stays.
    assert [path.name for path in folder.iterdir()] == [f"{RUNS[0]}.nc"]
    written = (folder / f"{RUNS[0]}.nc").stat().st_mtime_ns
    calls = []
    write_prepared(campaign, names=RUNS, progress=lambda *call: calls.append(call))
    assert (folder / f"{RUNS[0]}.nc").stat().st_mtime_ns == written
    assert calls[-1] == (2, 2, RUNS[1])
    assert {call[:2] for call in calls[:-1]} == {(1, 2)}  # one is done, also while clocks are found


def test_the_draft_of_the_raw_files_prepares_as_it_stands(copied):
    """What `seakeep init` makes of the tank's raw files, without its campaign file."""
    folder = copied().parent
    files = sorted((folder / "raw").glob("*/*.csv"))
    draft = folder / "draft.toml"
    draft.write_text(draft_campaign(files, folder), encoding="utf-8")
    campaign = read_campaign(draft)
    assert campaign.runs == list(RUNS)
    assert campaign.model().states[:2] == ("heave", "pitch")  # roll is noise in head seas
    assert campaign.model().inputs == ("eta_kn_fwd", "eta_kn_cog")
    run = campaign.prepare(["regular_2"])["regular_2"]
    # The clock of the camera, as the tank's own campaign file has it: within a tenth of a frame.
    assert run.attrs["clock_video_offset"] == pytest.approx(-1.2, abs=1 / 300)
    assert np.isfinite(run[["eta_kn_fwd", "heave", "surge", "mooring_bow"]].to_array()).all()
