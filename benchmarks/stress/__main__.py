"""``python -m benchmarks.stress``: see ``run``."""

from __future__ import annotations

from benchmarks.stress.run import main

if __name__ == "__main__":
    raise SystemExit(main())
