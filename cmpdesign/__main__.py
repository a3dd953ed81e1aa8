"""``python -m cmpdesign``: the program ``cmpdesign``."""

from __future__ import annotations

from cmpdesign.cli import main

if __name__ == "__main__":  # processes of multiprocessing import this file, too
    main()
