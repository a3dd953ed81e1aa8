"""``python -m benchmarks.codecs``: see ``run``."""

from __future__ import annotations

from benchmarks.codecs.run import main

if __name__ == "__main__":
    raise SystemExit(main())
