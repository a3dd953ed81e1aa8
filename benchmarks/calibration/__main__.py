"""``python -m benchmarks.calibration``: see ``run``."""

from __future__ import annotations

from benchmarks.calibration.run import main

if __name__ == "__main__":
    raise SystemExit(main())
