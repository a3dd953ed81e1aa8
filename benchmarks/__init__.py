"""Experiments, each a command ``python -m benchmarks.NAME``; ``frame`` runs them, ``suites`` holds their conditions.

Times are of one core: numpy, SciPy and Rust libraries read these variables when they are imported.
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["RAYON_NUM_THREADS"] = "1"
