"""``python -m benchmarks.camera``: see ``run``."""

from __future__ import annotations

from benchmarks.camera.run import main

if __name__ == "__main__":
    raise SystemExit(main())
