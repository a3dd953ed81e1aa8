"""``python -m benchmarks.rig``."""

import sys

from benchmarks.rig.run import main

sys.exit(main())
