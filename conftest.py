"""Settings of the whole test run that must be made before numpy is imported."""

import os

# Tests run side by side; a BLAS that spreads over all cores makes each of them slower.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
