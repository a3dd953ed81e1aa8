"""``python -m benchmarks.live``: see ``run``."""

from __future__ import annotations

from benchmarks.live.run import main

if __name__ == "__main__":
    raise SystemExit(main())
