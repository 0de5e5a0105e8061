"""Settings of the whole test run that must be made before numpy is imported."""

import os
from importlib.util import find_spec

# Tests run side by side; a BLAS that spreads over all cores makes each of them slower.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# The compiled loop of the tank cannot be imported without numba (extra tank).
collect_ignore = [] if find_spec("numba") else ["src/seakeep/tank/_loop.py"]
