"""The program ``cmpdesign``, also by ``python -m cmpdesign``. From this file's first lines on Ctrl-C is one line, while
the modules are loaded, too; what comes before is the start of Python and of the installed script.
"""

import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import TracebackType


def end_interrupted(kind: type[BaseException], error: BaseException, trace: "TracebackType | None") -> None:
    """One line where nothing else took the interruption; Python's own words for other errors."""
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
        return
    sys.stderr.write("error: interrupted; every file that was written is complete\n")
    sys.exit(130)


sys.excepthook = end_interrupted


def main() -> None:
    """Entry point of the program."""
    from cmpdesign.cli import main as run

    run()


if __name__ == "__main__":  # processes of multiprocessing import this file, too
    main()
