"""``python -m benchmarks.datasets``: see ``run``."""

from __future__ import annotations

from benchmarks.datasets.run import main

if __name__ == "__main__":
    raise SystemExit(main())
