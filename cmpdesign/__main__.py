"""``python -m cmpdesign``: the program ``cmpdesign``."""

from __future__ import annotations

from cmpdesign.cli import main

main()
