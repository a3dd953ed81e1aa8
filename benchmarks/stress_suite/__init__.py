"""The parts of the stress suite: conditions, frames, score and report. Times are of one core."""

import os

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")  # they are read when numpy and numba are first imported
