"""MATLAB 7.3: files of other writers, and what is left out; layouts: ``test_read_binary.py``."""

from pathlib import Path

import numpy as np
import pytest
import scipy
from matlab73 import MatFile
from numpy.testing import assert_allclose, assert_array_equal

from seakeep.campaign import read_table
from seakeep.formats import read_columns

T = np.arange(200) * 0.05
HEAVE = np.sin(T)


def test_a_file_that_matlab_wrote():
    """The one that scipy carries, to refuse it: a vector ``testdouble`` of nine elements."""
    path = Path(scipy.__file__).parent / "io/matlab/tests/data/testhdf5_7.4_GLNX86.mat"
    if not path.exists():
        pytest.skip("this build of scipy leaves its tests out")
    columns = read_columns(path)
    assert columns.names == ["testdouble"]
    assert_allclose(columns.values["testdouble"], np.linspace(0, 2 * np.pi, 9))


@pytest.mark.oracle
# The other writer's own use of numpy, from numpy 2.5 on; the reader does not touch it.
@pytest.mark.filterwarnings("ignore:The chararray class is deprecated:DeprecationWarning")
def test_files_of_another_writer(tmp_path):
    storage = pytest.importorskip("hdf5storage")
    run = {"time": T[:, None], "heave": HEAVE[:, None], "units": {"heave": "mm"}}
    storage.savemat(str(tmp_path / "run.mat"), {"run": run}, format="7.3")
    table = read_table(tmp_path / "run.mat")
    assert_array_equal(table["heave"], HEAVE)
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
