"""Every reader fed what is no run: one error that says what it is and how to fix it."""

import os
import re
import shutil

import h5py
import matlab73
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from records import record
from said import data_error, request_error, warned
from scipy import io
from small_tank import tank_columns, write_csv

from seakeep.campaign import read_table
from seakeep.errors import MissingFileError

T = 0.05 * np.arange(400)
HEAVE = np.sin(T)
SERIES = {"time": T, "heave": HEAVE}
RUN = record(0.05, heave=HEAVE)


def hdf5(path):
    with h5py.File(path, "w") as file:
        file["time"], file["heave"] = T, HEAVE


def tdms(path):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("run", "heave", HEAVE, {"wf_increment": 0.05})])


def mcap(path):
    pytest.importorskip("rosbags")
    from bags import STORE, write_bag

    kind = STORE.types["std_msgs/msg/Float64"]
    sent = ((int(1e9 * t), "/heave", kind(data=x)) for t, x in zip(T, HEAVE, strict=True))
    folder = write_bag(path.with_name("bag"), sent)
    shutil.move(next(folder.glob("*.mcap")), path)
    shutil.rmtree(folder)


READERS = {
    "csv": lambda path: write_csv(path, {"time [s]": T, "heave [m]": HEAVE}),
    "v5.mat": lambda path: io.savemat(path, SERIES),
    "v73.mat": lambda path: matlab73.save(path, SERIES),
    "nc": lambda path: RUN.to_netcdf(path, engine="h5netcdf"),
    "3.nc": lambda path: RUN.to_netcdf(path, engine="scipy"),
    "h5": hdf5,
    "tdms": tdms,
    "mcap": mcap,
}


@pytest.fixture(params=READERS)
def path(request, tmp_path):
    """A sound file of each kind."""
    made = tmp_path / f"run.{request.param}"
    READERS[request.param](made)
    assert read_table(made).sizes["time"] == T.size
    return made


@pytest.mark.parametrize("part", [0.15, 0.5, 0.9])
def test_truncated(path, part):
    if path.suffix == ".csv":
        return  # below: a text that is cut off is one still
    whole = path.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    with data_error(r"run\..*cut off.*(Copy|copy|Save it again|Export it again|was not closed)"):
        read_table(path)


@pytest.mark.parametrize("left", range(1, 12))
def test_a_text_cut_off_within_its_last_line(tmp_path, left):
    """Wherever it is cut: too few cells are an error, a last cell too short a warning."""
    path = tmp_path / "run.csv"
    lines = ["t,heave", *(f"{t:.3f},{x:.5f}" for t, x in zip(T, 2 + HEAVE, strict=True))]
    last = lines[200]
    path.write_text("\n".join([*lines[:200], last[:left]]))
    if left > last.index(","):
        shown = re.escape(repr(last[:left].split(",")[1].strip()))
        with warned(f"ends within line 201, at {shown}: it seems"):
            read_table(path)
    else:
        with data_error(r"line 201: 1 cells where .* the file was cut off"):
            read_table(path)
    path.write_text("\n".join([*lines[:200], last]))  # whole, without an end: no word
    assert read_table(path).sizes["time"] == 200


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_text_under_the_name_of_a_binary_format(path, encoding):
    """A table that is not UTF-8 either; a text file's own reader takes it."""
    path.write_bytes("tid [s],vinkel [°]\n0,1\n1,2\n".encode(encoding))
    if path.suffix == ".csv":
        assert read_table(path)["vinkel"].attrs["units"] == "°"
        return
    with data_error(
        r"run\..* is not a valid (MATLAB|NetCDF|HDF5|TDMS|MCAP) file: it holds text and "
        r"starts with 'tid \[s\],vinkel .*If it is a table, name it \.csv or \.txt; else copy or"
    ):
        read_table(path)


@pytest.mark.parametrize("suffix", [".csv", ".dat", ".mat", ""])
@pytest.mark.parametrize("kind", ["nc", "3.nc", "h5", "v5.mat", "v73.mat", "tdms"])
def test_a_sound_file_under_another_name_is_recognised(tmp_path, kind, suffix):
    path = tmp_path / "run.x"
    READERS[kind](path)
    path = path.rename(tmp_path / f"run{suffix}")
    assert_array_equal(read_table(path)["heave"], HEAVE)


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


def test_a_stated_unit_against_a_header(tank, changed):
    stated = 'column = "Heave"', 'column = "Heave"\nunit = "mm"'

    def prepared(header, *more):
        columns = tank_columns(1)
        heave = {"m": 1e-3}.get(header, 1.0) * columns.pop("Heave [mm]")
        columns[f"Heave [{header}]" if header else "Heave"] = heave
        write_csv(tank / "second.csv", columns)
        return changed(stated, *more).prepare()

    for header in ("mm", "-", ""):
        assert "second" in prepared(header)
    for header in ("m", "deg"):
        with request_error(
            rf"channels\.heave: the unit 'mm' is stated, and run 'second' \(.*\.csv\) "
            rf"says '{header}' for the column 'Heave'\. Leave unit out if all files say one; if "
            rf"some say none, state '{header}', and in \[runs\.RUN\.channels\.heave\] the unit of "
            "each that has another; or, if this file is wrong, state its unit in "
            r"\[runs\.second\.channels\.heave\]"
        ):
            prepared(header)
    mended = "[preparation]", "[runs.second.channels.heave]\nunit = 'm'\n[preparation]"
    with warned(r"heave leaves its mean by .* Check unit"):
        runs = prepared("deg", mended)  # millimetres, now said to be metres
    assert runs["second"]["heave"].std() > 1.0
