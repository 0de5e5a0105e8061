"""MATLAB, NetCDF and HDF5."""

from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy
import xarray as xr
from matlab73 import save as matlab73
from numpy.testing import assert_allclose, assert_array_equal
from said import data_error

from seakeep.campaign import read_table
from seakeep.campaign.settings import FileSettings
from seakeep.formats import read_columns

T = np.arange(200) * 0.05
HEAVE, WAVE = np.sin(T), np.cos(T)


def check(run, unit="mm"):
    assert_array_equal(run["time"], T)
    assert_array_equal(run["heave"], HEAVE)
    assert_array_equal(run["wave"], WAVE)
    assert run["heave"].attrs.get("units") == unit
    assert set(run.data_vars) == {"heave", "wave"}


NAMES = np.array(["time", "heave", "wave"], dtype=object)
UNITS = np.array(["s", "mm", "m"], dtype=object)
MATRIX = np.column_stack([T, HEAVE, WAVE])
BOTH = {"heave": HEAVE, "wave": WAVE, "units": {"heave": "mm"}}
SOUND = {"time": T, **BOTH}
UNTIMED = {"data": MATRIX[:, 1:], "names": NAMES[1:], "units": UNITS[1:]}


@pytest.mark.parametrize(
    "content",
    [
        {**SOUND, "units": {"heave": "mm", "wave": "m"}},
        {**SOUND, "time": T[:, None], "heave": HEAVE[None, :]},
        {"run": SOUND},
        {"data": MATRIX, "names": NAMES, "units": UNITS},
        {"run": {"data": MATRIX, "channels": NAMES, "units": UNITS}},
        {"time": T, **UNTIMED},
        {"Fs": 20.0, **UNTIMED},
        {"dt": 0.05, **BOTH, "remark": "Größe"},
        {"data": BOTH, "fs": 20.0, "note": True},
        {"data": MATRIX, "labels": np.array(["Time [s]", "heave [mm]", "wave (m)"], dtype=object)},
    ],
)
@pytest.mark.parametrize(
    "save", [scipy.io.savemat, partial(scipy.io.savemat, do_compression=True), matlab73]
)
def test_matlab(tmp_path, content, save):
    save(tmp_path / "run.mat", content)
    run = read_table(tmp_path / "run.mat")
    # A step of 0.05 turned into a rate and back: rounding.
    assert_allclose(run["time"], T, rtol=1e-15)
    check(run.assign_coords(time=T))


GAINS = {"gains": np.ones(7)}


@pytest.mark.parametrize(
    ("content", "fault", "words"),
    [
        ({"run": SOUND, **GAINS}, "gains", "'gains' has 7 values, and the time 200. Save chan"),
        ({"time": T, **UNTIMED, **GAINS}, "gains", "'gains' has 7 values, and the time 200"),
        ({"dt": 0.05, **BOTH, **GAINS}, "gains", "'gains' has 7 values, and most 200"),
        ({"dt": 0.05, **BOTH, "f": np.ones(300)}, "f", "'f' has 300 values, and most 200"),
        ({"t_DAQ": T, "early": T[1:], **BOTH}, "early", "has 199 values, and most 200"),
        ({**SOUND, "loads": {"bow": T}}, "loads", "'loads' is a struct beside other channels. Sa"),
        ({"run": SOUND, "about": {"gains": np.ones(7)}}, "about", "'about' is a struct beside"),
        (
            {**SOUND, "units": UNITS},
            "units",
            "'units' lists 3 units, and no list says of which columns",
        ),
        ({"run": SOUND, "about": {"date": "1 May"}}, None, ""),
    ],
)
@pytest.mark.parametrize("save", [scipy.io.savemat, matlab73])
def test_what_stands_beside_the_channels_of_a_matlab_file(tmp_path, content, fault, words, save):
    """It is no channel, and stops none: a fault says what to do."""
    save(tmp_path / "run.mat", content)
    table = read_columns(tmp_path / "run.mat")
    assert_array_equal(table.values["heave"], HEAVE)
    assert_array_equal(table.values["wave"], WAVE)
    assert list(table.faults) == ([fault] if fault else [])
    if fault:
        assert fault not in table.values
        assert words in table.faults[fault]


def test_a_file_of_matlab_7_3():
    """The one that scipy carries, to refuse it: a vector ``testdouble`` of nine elements."""
    path = Path(scipy.__file__).parent / "io/matlab/tests/data/testhdf5_7.4_GLNX86.mat"
    if not path.exists():
        pytest.skip("this build of scipy leaves its tests out")
    columns = read_columns(path)
    assert columns.names == ["testdouble"]
    assert_allclose(columns.values["testdouble"], np.linspace(0, 2 * np.pi, 9))


def test_classes_of_matlab_that_are_left_out(tmp_path):
    path = tmp_path / "run.mat"
    matlab73(path, {"time": T, "heave": np.sin(T)})
    with h5py.File(path, "a") as file:
        file.create_group("S").attrs["MATLAB_sparse"] = 200
        empty = file.create_dataset("none", data=np.zeros(2, np.uint64))
        empty.attrs["MATLAB_class"], empty.attrs["MATLAB_empty"] = np.bytes_("double"), 1
        phasor = np.zeros((200, 1), [("real", "f8"), ("imag", "f8")])
        file.create_dataset("phasor", data=phasor).attrs["MATLAB_class"] = np.bytes_("double")
    assert set(read_table(path).data_vars) == {"heave"}


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_netcdf(tmp_path, engine):
    run = xr.Dataset(
        {"heave": ("time", HEAVE, {"units": "mm"}), "wave": ("time", WAVE), "depth": ((), 3.6)},
        {"time": ("time", T, {"units": "s"})},
    )
    run.to_netcdf(tmp_path / "run.nc", engine=engine)
    check(read_table(tmp_path / "run.nc"))


def test_netcdf_table_with_names(tmp_path):
    table = xr.DataArray(
        MATRIX[:, 1:], dims=("time", "channel"), coords={"time": T, "channel": ["heave", "wave"]}
    )
    table.to_dataset(name="data").to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    check(read_table(tmp_path / "run.nc"), unit=None)


def test_netcdf_transposed(tmp_path):
    table = xr.DataArray(MATRIX.T, dims=("channel", "time"), coords={"time": T})
    table.to_dataset(name="data").to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with data_error(
        r"'data' has dimensions \(channel: 3, time: 200\), which looks transposed; expected "
        r"time first, \(time, channel\)"
    ):
        read_table(tmp_path / "run.nc")


def test_hdf5_groups(tmp_path):
    path, groups = tmp_path / "run.h5", ("basin/run1", "basin/run2")
    with h5py.File(path, "w") as file:
        for group in groups:
            place = file.create_group(group)
            place["time"], place["heave"], place["wave"] = T, HEAVE, WAVE
            place["heave"].attrs["units"] = "mm"
    with data_error(
        r"no channels outside its groups: 'basin/run1' \(3 sets\), 'basin/run2' \(3 sets\)\. "
        r"State which one with group = 'NAME' in \[files\] or \[instruments\.LOGGER\], or give "
        r"--group NAME to seakeep init"
    ):
        read_table(path)
    check(read_table(path, FileSettings(group="basin/run2")))
    with data_error(
        r"has no group 'basin/run8'\. Did you mean .*\? Its groups: .* Correct 'group'"
    ):
        read_table(path, FileSettings(group="basin/run8"))
    with h5py.File(path, "a") as file:
        del file["basin/run1"]
    check(read_table(path))  # the only one


def test_hdf5_vectors_of_one_row_and_either_word_for_units(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for name, values in {"time": T, "heave": HEAVE, "wave": WAVE}.items():
            file[name] = values[None, :]
        file["heave"].attrs["unit"] = "mm"
    check(read_table(tmp_path / "run.h5"))


def test_hdf5_sets_of_several_columns_are_split(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["time"], file["acc"] = T, np.column_stack([HEAVE, WAVE, T])
        file["acc"].attrs["units"] = "m/s2"
        file["picture"] = np.zeros((200, 65))
    columns = ["acc_1", "acc_2", "acc_3"]
    run = read_table(tmp_path / "run.h5", columns=columns)
    assert_array_equal(run["acc_2"], WAVE)
    assert [run[name].attrs["units"] for name in columns] == ["m/s2"] * 3
    with data_error(r"'picture' has 65 columns without names; beyond 64"):
        read_table(tmp_path / "run.h5", columns=["picture"])
