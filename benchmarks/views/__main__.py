"""``python -m benchmarks.views``: see ``run``."""

from __future__ import annotations

from benchmarks.views.run import main

if __name__ == "__main__":
    raise SystemExit(main())
