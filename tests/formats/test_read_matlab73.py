"""MATLAB 7.3: a file of MATLAB, and what is left out; layouts: ``test_read_binary.py``."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy
from matlab73 import save
from numpy.testing import assert_allclose

from seakeep.campaign import read_table
from seakeep.formats import read_columns

T = np.arange(200) * 0.05


def test_a_file_that_matlab_wrote():
    """The one that scipy carries, to refuse it: a vector ``testdouble`` of nine elements."""
    path = Path(scipy.__file__).parent / "io/matlab/tests/data/testhdf5_7.4_GLNX86.mat"
    if not path.exists():
        pytest.skip("this build of scipy leaves its tests out")
    columns = read_columns(path)
    assert columns.names == ["testdouble"]
    assert_allclose(columns.values["testdouble"], np.linspace(0, 2 * np.pi, 9))


def test_classes_that_are_left_out(tmp_path):
    path = tmp_path / "run.mat"
    save(path, {"time": T, "heave": np.sin(T)})
    with h5py.File(path, "a") as file:
        file.create_group("S").attrs["MATLAB_sparse"] = 200
        empty = file.create_dataset("none", data=np.zeros(2, np.uint64))
        empty.attrs["MATLAB_class"], empty.attrs["MATLAB_empty"] = np.bytes_("double"), 1
        phasor = np.zeros((200, 1), [("real", "f8"), ("imag", "f8")])
        file.create_dataset("phasor", data=phasor).attrs["MATLAB_class"] = np.bytes_("double")
    assert set(read_table(path).data_vars) == {"heave"}
