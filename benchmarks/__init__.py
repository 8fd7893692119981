"""Run time against error, and tables of comparison: cases and tables in one registry, measured by one harness.

`python -m benchmarks list | run | docs`. A new row is a `Case` or `Table` in the `ENTRIES` of a module that
`registry.SUBJECTS` names; nothing else has to change.
"""

import os

# Before numpy is loaded: one BLAS thread, the matrices are small, and figures are comparable only with a fixed number.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
