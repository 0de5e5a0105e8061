"""Files laid out as ``save -v7.3`` of MATLAB lays them out."""

import h5py
import numpy as np

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
        if isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype.kind == "O"):
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


def save(path, variables):
    """Write variables as `scipy.io.savemat` does in older formats."""
    with MatFile(path) as file:
        for name, value in variables.items():
            file.put(name, value)
