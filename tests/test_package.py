"""The package as a whole: its public names, and what starting it imports."""

import os
import subprocess
import sys

import pytest

import seakeep

HEAVY = ("scipy", "pandas", "xarray", "matplotlib", "numba")
REQUESTS = (
    ["--help"],
    ["--version"],
    ["fti", "campaign.toml"],
    ["fit"],
    ["fit", "campaign.toml", "--modle", "ensemble"],
    ["study", "study.toml", "--workers", "none"],
    ["info"],
)
VERBS = (
    "tank", "init", "prepare", "tune", "fit", "calibrate", "forecast", "compare", "export", "check",
    "study", "report", "reproduce", "datasets", "track", "info",
)  # fmt: skip


def printed(*words, **environment):
    """What a fresh interpreter prints."""
    command, environment = [sys.executable, *words], os.environ | environment
    return subprocess.run(
        command, capture_output=True, text=True, check=True, env=environment
    ).stdout


def imported_by(code):
    """Which of the heavy packages a fresh interpreter holds after running the code."""
    asked = f"{code}\nimport sys\nprint([m for m in {HEAVY!r} if m in sys.modules])"
    return printed("-c", asked).splitlines()[-1]


def test_help_version_and_wrong_requests_start_without_heavy_packages():
    requests = [*REQUESTS, *([verb, "--help"] for verb in VERBS)]
    code = f"from seakeep.cli import main\nfor request in {requests!r}:\n    main(list(request))"
    assert imported_by(code) == "[]"


def test_a_room_is_imported_when_it_is_used():
    assert imported_by("import seakeep; dir(seakeep)") == "[]"
    assert "xarray" in imported_by("import seakeep; seakeep.study.run_study, seakeep.HankelDMDc")


def test_the_public_names_are_there_and_no_others_are_shown():
    assert dir(seakeep) == sorted(seakeep.__all__)
    for name in dir(seakeep):
        assert getattr(seakeep, name) is not None
    assert not [name for name in dir(seakeep) if name.startswith("_")]


def test_an_unknown_name_is_refused():
    with pytest.raises(AttributeError, match="HankelDMD"):
        _ = seakeep.HankelDMD


def test_no_summary_in_the_help_is_cut_at_eighty_columns():
    listed = printed("-m", "seakeep", "--help", COLUMNS="80").partition("Commands:")[2].split("\n")
    assert {line.split()[0] for line in listed if line.strip()} == set(VERBS)
    assert not [line for line in listed if "..." in line or "…" in line or len(line) > 80]
