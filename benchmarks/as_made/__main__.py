"""``python -m benchmarks.as_made``: see ``run``."""

from __future__ import annotations

from benchmarks.as_made.run import main

if __name__ == "__main__":
    raise SystemExit(main())
