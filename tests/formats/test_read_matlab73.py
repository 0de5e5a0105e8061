"""MATLAB 7.3: files laid out as ``save -v7.3`` lays them out, and one that MATLAB wrote."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy

from seakeep.campaign import read_table
from seakeep.formats import read_columns

T = np.arange(200) * 0.05
HEAVE, WAVE = np.sin(T), np.cos(T)
MATRIX = np.column_stack([T, HEAVE, WAVE])
NAMES = ["time", "heave", "wave"]
CLASSES = {"f8": "double", "f4": "single", "i4": "int32", "u1": "uint8"}


class MatFile:
    """Write variables as MATLAB does: dimensions reversed, classes in attributes."""

    def __init__(self, path):
        self.path = path
        self.file = h5py.File(path, "w", userblock_size=512)
        self.references = self.file.create_group("#refs#")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()
        head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 ."
        with self.path.open("r+b") as raw:
            raw.write(head.ljust(124) + b"\x00\x02IM")

    def put(self, name, value, parent=None):
        parent = self.file if parent is None else parent
        if isinstance(value, dict):
            group = parent.create_group(name)
            group.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, each in value.items():
                self.put(key, each, group)
            return group
        if isinstance(value, str):
            units = np.frombuffer(value.encode("utf-16-le"), "<u2")
            return self._array(parent, name, units[None, :], "char")
        if isinstance(value, list):
            cells = np.empty((1, len(value)), dtype=h5py.ref_dtype)
            for i, each in enumerate(value):
                item = self.put(f"c{len(self.references)}", each, self.references)
                cells[0, i] = item.ref
            return self._array(parent, name, cells, "cell")
        array = np.asarray(value)
        kind = "logical" if array.dtype == bool else CLASSES[array.dtype.str[1:]]
        array = array.astype("u1") if array.dtype == bool else array
        return self._array(parent, name, np.atleast_2d(array), kind)

    def _array(self, parent, name, array, kind):
        item = parent.create_dataset(name, data=array.T)
        item.attrs["MATLAB_class"] = np.bytes_(kind)
        return item


def save(path, **variables):
    with MatFile(path) as file:
        for name, value in variables.items():
            file.put(name, value)
    return path


UNITS = {"heave": "mm", "wave": "m"}


@pytest.mark.parametrize(
    "content",
    [
        {"time": T, "heave": HEAVE, "wave": WAVE, "units": UNITS},
        {"run": {"time": T, "heave": HEAVE, "wave": WAVE, "units": UNITS}},
        {"data": MATRIX, "names": NAMES, "units": ["s", "mm", "m"]},
        {"Fs": 20.0, "data": MATRIX[:, 1:], "names": NAMES[1:], "units": ["mm", "m"]},
        {"time": T, "heave": HEAVE, "wave": WAVE, "units": UNITS, "comment": "Größe", "ok": True},
    ],
    ids=["rows", "struct", "matrix", "rate", "texts"],
)
def test_layouts(tmp_path, content):
    run = read_table(save(tmp_path / "run.mat", **content))
    # A step of 0.05 turned into a rate and back: rounding.
    np.testing.assert_allclose(run["time"], T, rtol=1e-15)
    np.testing.assert_array_equal(run["heave"], HEAVE)
    np.testing.assert_array_equal(run["wave"], WAVE)
    assert run["heave"].attrs["units"] == "mm"
    assert set(run.data_vars) == {"heave", "wave"}


def test_a_file_that_matlab_wrote():
    """The one that scipy carries, to refuse it: a vector ``testdouble`` of nine elements."""
    path = Path(scipy.__file__).parent / "io/matlab/tests/data/testhdf5_7.4_GLNX86.mat"
    if not path.exists():
        pytest.skip("this build of scipy leaves its tests out")
    columns = read_columns(path)
    assert columns.names == ["testdouble"]
    np.testing.assert_allclose(columns.values["testdouble"], np.linspace(0, 2 * np.pi, 9))


@pytest.mark.oracle
# The other writer's own use of numpy, from numpy 2.5 on; the reader does not touch it.
@pytest.mark.filterwarnings("ignore:The chararray class is deprecated:DeprecationWarning")
def test_files_of_another_writer(tmp_path):
    storage = pytest.importorskip("hdf5storage")
    run = {"time": T[:, None], "heave": HEAVE[:, None], "units": {"heave": "mm"}}
    storage.savemat(str(tmp_path / "run.mat"), {"run": run}, format="7.3")
    table = read_table(tmp_path / "run.mat")
    np.testing.assert_array_equal(table["heave"], HEAVE)
    assert table["heave"].attrs["units"] == "mm"


def test_classes_that_are_left_out(tmp_path):
    path = tmp_path / "run.mat"
    with MatFile(path) as file:
        for name, values in (("time", T), ("heave", HEAVE)):
            file.put(name, values)
        sparse = file.file.create_group("S")
        sparse.attrs["MATLAB_sparse"] = 200
        empty = file.file.create_dataset("none", data=np.zeros(2, np.uint64))
        empty.attrs["MATLAB_class"], empty.attrs["MATLAB_empty"] = np.bytes_("double"), 1
        phasor = np.zeros((200, 1), [("real", "f8"), ("imag", "f8")])
        file.file.create_dataset("phasor", data=phasor).attrs["MATLAB_class"] = np.bytes_("double")
    assert set(read_table(path).data_vars) == {"heave"}
