"""``python -m benchmarks.medium``: see ``run``."""

from __future__ import annotations

from benchmarks.medium.run import main

if __name__ == "__main__":
    main()
