"""``python -m benchmarks.sweeps``: see ``run``."""

from __future__ import annotations

from benchmarks.sweeps.run import main

if __name__ == "__main__":
    raise SystemExit(main())
