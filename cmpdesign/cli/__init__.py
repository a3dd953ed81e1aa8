"""The command line: parses, calls and prints. One file per command; heavy modules are imported when a command runs.

In: the words of a command line. Out: files, lines, an exit code.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmpdesign.cli.app import app as app

__all__ = ["app", "main"]


def main() -> None:
    """Entry point of the ``cmpdesign`` program. Its modules are imported here, so that Ctrl-C is one line then, too."""
    try:
        from cmpdesign.cli.app import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("error: interrupted; every file that was written is complete\n")
        sys.exit(130)


def __getattr__(name: str) -> Any:
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from cmpdesign.cli.app import app

    return app
