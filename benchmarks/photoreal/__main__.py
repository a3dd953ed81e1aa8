"""``python -m benchmarks.photoreal``: see ``run``."""

from __future__ import annotations

from benchmarks.photoreal.run import main

if __name__ == "__main__":
    raise SystemExit(main())
