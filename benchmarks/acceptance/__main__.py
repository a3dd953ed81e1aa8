"""``python -m benchmarks.acceptance``: see ``run``."""

from __future__ import annotations

from benchmarks.acceptance.run import main

if __name__ == "__main__":
    raise SystemExit(main())
