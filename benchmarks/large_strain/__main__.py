"""``python -m benchmarks.large_strain``: see ``run``."""

from __future__ import annotations

from benchmarks.large_strain.run import main

if __name__ == "__main__":
    raise SystemExit(main())
