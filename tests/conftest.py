"""Settings that hold for every test; they are made before numpy is first imported."""

import os

# One BLAS thread: the order of sums, and so the last digits, does not depend on the machine's cores.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(variable, "1")
os.environ.setdefault("MPLBACKEND", "Agg")  # no screen
