"""Files of ``save -v7.3`` of MATLAB, by hdf5storage."""

import warnings

import pytest


def save(path, variables):
    """Write variables as `scipy.io.savemat` does in older formats."""
    storage = pytest.importorskip("hdf5storage")
    with warnings.catch_warnings():
        # Its own use of numpy, from numpy 2.5 on: the chararray class is deprecated.
        warnings.simplefilter("ignore", DeprecationWarning)
        storage.savemat(str(path), variables, format="7.3", appendmat=False)
