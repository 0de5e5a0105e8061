"""Files are hashed in pieces, and again only when they have changed."""

import hashlib
from collections import Counter
from pathlib import Path

import pytest

from seakeep.campaign import load_prepared, read_campaign, write_prepared


@pytest.fixture
def hashed(monkeypatch):
    """How often each file was read."""
    count, digest = Counter(), hashlib.file_digest

    def counting(file, name):
        count[Path(file.name).name] += 1
        return digest(file, name)

    monkeypatch.setattr(hashlib, "file_digest", counting)
    return count


def test_a_campaign_reads_each_file_once_for_its_checksum(tank, edited, hashed):
    # The period is measured on all runs, so that each run depends on the files of all.
    path = edited(("sampling_rate = 10", "steps_per_period = 16"))
    write_prepared(read_campaign(path))
    assert hashed == {"first.csv": 1, "second.csv": 1}
    load_prepared(read_campaign(path))
    assert hashed == {"first.csv": 1, "second.csv": 1}
