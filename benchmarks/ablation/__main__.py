"""``python -m benchmarks.ablation``: see ``run``."""

from __future__ import annotations

from benchmarks.ablation.run import main

if __name__ == "__main__":
    raise SystemExit(main())
