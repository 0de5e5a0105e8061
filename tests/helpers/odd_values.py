"""What users give by mistake in the place of an argument."""

import numpy as np
import xarray as xr
from array_calls import T, X

RUN = xr.Dataset({"heave": ("time", X), "pitch": ("time", X)}, {"time": T})

ODD = {
    "None": None, "text": "x", "empty text": "", "bool": True, "zero": 0, "minus one": -1,
    "half": 0.5, "NaN": np.nan, "infinity": np.inf, "minus infinity": -np.inf, "huge": 1e300,
    "tiny": 5e-324, "small": 1e-200, "long": 10**400, "digits": 10**5000, "2^63": 2**63,
    "list": [1.0, 2.0], "nested": [[1, 2], [3]], "empty list": [], "texts": ["a", "b"],
    "dict": {"a": 1}, "tuple": (), "pair": (2.0, 1.0), "complex": 1j, "bytes": b"x", "set": {1},
    "generator": (each for each in [1]), "function": print, "class": dict, "object": object(),
    "Dataset": RUN, "DataArray": xr.DataArray(X), "array": np.arange(3.0),
    "0-d": np.array(1.0), "float32": np.float32(2.0), "int64": np.int64(3),
    "date": np.datetime64("2020-01-01"), "masked": np.ma.masked, "mapping of text": {"a": "b"},
    "None list": [None], "seed": np.random.SeedSequence(1),
}  # fmt: skip
