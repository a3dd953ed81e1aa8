"""The program ``cmpdesign``, also by ``python -m cmpdesign``. Its modules are loaded within ``main``, so that Ctrl-C
is one line from then on.
"""

from __future__ import annotations

import sys


def main() -> None:
    """Entry point of the program."""
    try:
        from cmpdesign.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("error: interrupted; every file that was written is complete\n")
        sys.exit(130)


if __name__ == "__main__":  # processes of multiprocessing import this file, too
    main()
