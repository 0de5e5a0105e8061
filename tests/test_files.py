"""Files are written whole or not at all."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from said import request_error

from seakeep.files import MARK, check_output, load_sealed, replacing, write_netcdf, write_sealed


def test_a_file_appears_when_it_is_whole_and_a_failure_leaves_the_old_one_and_no_litter(tmp_path):
    path = tmp_path / "a.txt"
    with replacing(path) as temporary:
        temporary.write_text("old")
        assert not path.exists()

    def fail():
        with replacing(path) as temporary:
            temporary.write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("place", "error", "message"),
    [
        ("a.txt", 28, r"cannot write .*a\.txt: No space left on device\. The f.*Free space"),
        ("a.txt", 13, r"Permission denied\. .* folder that you may write to"),
        ("no/a.txt", None, r"does not exist\. Create it first"),
        (".", None, r"it is a folder\. Name a file\."),
        ("old/b", None, r"the folder .*old does not exist\. Create it first"),
    ],
)
def test_what_keeps_a_file_from_being_written_is_named(tmp_path, place, error, message):
    (tmp_path / "old").write_text("")
    with request_error(message), replacing(tmp_path / place):
        raise OSError(error, os.strerror(error))


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_file_that_is_replaced_keeps_its_permissions(tmp_path):
    """Written anew, a private file (0600) could be read by the group."""
    place = tmp_path / "a.txt"
    for mode in (0o600, 0o444, 0o664):
        place.touch()
        place.chmod(mode)
        with replacing(place) as temporary:
            temporary.write_text("x")
        assert place.stat().st_mode & 0o777 == mode


def test_a_sealed_file_holds_what_was_written_for_us_and_for_xarray(tmp_path):
    values, path = np.random.default_rng(0).standard_normal(5000), tmp_path / "a.nc"
    heave = xr.Dataset(
        {
            "heave": ("time", values, {"units": "m"}),
            "flag": ("time", values > 0),
            "name": ("part", ["a", "Ä"]),
        },
        coords={"time": 0.1 * np.arange(5000), "depth": 3.0},
        attrs={"title": "Mörkö", "span": (1.0, 2.0)},
    )
    write_sealed(heave, path, "model")
    ours = load_sealed(path, "model")
    for found in (ours, xr.load_dataset(path, engine="h5netcdf")):
        xr.testing.assert_equal(found, heave)
        assert found["heave"].attrs == {"units": "m"}
        assert found.attrs["title"] == "Mörkö"
    assert ours.attrs["span"] == (1.0, 2.0)
    assert ours["flag"].dtype == bool


FULL = """
import json, resource, signal, sys
from pathlib import Path
import numpy as np, xarray as xr
from seakeep.errors import SeakeepError
from seakeep.files import write_sealed
from seakeep.report import comparison
from seakeep.study import store as study
from seakeep.tank import play

folder = Path(sys.argv[1])
run = xr.Dataset({"heave": ("time", np.random.rand(50_000), {"units": "m"})})
writers = {
    "model": lambda path: write_sealed(run, path, "model"),
    "forecast": lambda path: comparison.write_forecast(run, path),
    "raw file": lambda path: play.write_record(run, path),
    "study": lambda path: study.write_result(study.StudyResult(folder, {}, {"prepared": run})),
}
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
told = {}
for name, write in writers.items():
    try:
        write(folder / "file.nc")
    except SeakeepError as error:
        told[name] = [type(error).__name__, str(error)]
print(json.dumps(told))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of file size are POSIX")
def test_whatever_is_written_as_netcdf_survives_a_disk_that_is_full(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(folder)], capture_output=True, text=True, check=False
    )
    # Once HDF5 itself has failed to write, it ends the process by SIGSEGV.
    assert (done.returncode, done.stderr) == (0, "")
    told = json.loads(done.stdout)
    kind, words = told.pop("study")
    assert kind == "StorageError"
    assert "File too large" in words
    assert "Free space on the disk" in words
    assert len(told) == 3
    for kind, words in told.values():
        assert kind == "RequestError"
        assert "file.nc: File too large" in words
        assert "Free space on the disk" in words
    assert not list(folder.rglob("*"))


# No output replaces an input, or a file that seakeep did not write.


def test_an_input_is_kept_under_any_name(tmp_path):
    raw = tmp_path / "raw.csv"
    raw.write_text("time [s],heave [m]\n")
    (tmp_path / "same.csv").symlink_to(raw)
    with request_error(r"same\.csv is read by this command and would be"):
        check_output(tmp_path / "same.csv", "forecast", [raw], "time.*")


def test_a_netcdf_file_is_replaced_by_one_of_its_kind(tmp_path):
    path = tmp_path / "a.nc"
    write_netcdf(path, xr.Dataset(attrs={MARK: "model"}))
    check_output(path, "model")
    with request_error("exists and is not a forecast that seakeep wrote"):
        check_output(path, "forecast")
    write_netcdf(path, xr.Dataset({"heave": ("time", [1.0])}))
    with request_error(r"may be a measurement\. Choose another name"):
        check_output(path, "model")
    path.write_bytes(b"CDF\x01")
    with request_error("exists and is not a model"):
        check_output(path, "model")


def test_a_table_of_any_width_is_known_by_its_start(tmp_path):
    path, names = tmp_path / "a.csv", ",".join(f"member {k:04}" for k in range(2000))
    path.write_text(f"time,{names}\n1\n")
    check_output(path, "forecast", header=r"time(,member \d+)+\n")


def test_text_states_what_it_is_and_csv_by_its_header(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("# seakeep_file: campaign\n")
    check_output(path, "campaign")
    path.write_text("#" * 100_000 + "\n# seakeep_file: campaign\n" + "#" * 100_000)
    check_output(path, "campaign")
    path.write_text("[campaign]\n")
    with request_error("exists and is not a campaign"):
        check_output(path, "campaign")
    table = tmp_path / "a.csv"
    table.write_text("run,channel\n1,2\n")
    check_output(table, "table", header="run,channel")
    with request_error("exists and is not a table"):
        check_output(table, "table", header="time,.*")
