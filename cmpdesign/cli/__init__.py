"""The command line: parses, calls and prints. One file per command; heavy modules are imported when a command runs.

In: the words of a command line. Out: files, lines, an exit code.
"""

from __future__ import annotations

from cmpdesign.cli.app import app, main

__all__ = ["app", "main"]
