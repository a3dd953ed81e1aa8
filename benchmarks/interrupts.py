"""Ctrl-C while the program starts: what a user sees, by the time of the signal.

    python -m benchmarks.interrupts [--signals N] [--until MS] [--seed N] [--program FILE] [--json FILE]

Starts the installed script ``cmpdesign`` of this environment again and again, sends SIGINT after a processor time that is
drawn uniformly (on an idle machine this is the time since the start; it does not depend on the load), and counts: one line and exit code 130; ended by the signal before Python takes signals, without a word (the
shell reports 130); a traceback, of Python's own start or of the installed script.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks.support.machine import conditions_text, write_json

PROGRAM = Path(sys.executable).with_name("cmpdesign")
OUTCOMES = ("one line, 130", "ended by the signal", "traceback", "had ended")
POLL_S = 0.0005


def processor_s(pid: int) -> float:
    """Time that a process has run on a processor."""
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[0]) / 1e9
    except OSError:  # it has ended
        return float("inf")


def outcome_of(program: Path, delay_s: float) -> tuple[str, str]:
    """What a signal after this processor time does, and what was printed."""
    process = subprocess.Popen(
        [program, "templates"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    while process.poll() is None and processor_s(process.pid) < delay_s:
        time.sleep(POLL_S)
    process.send_signal(signal.SIGINT)
    _, printed = process.communicate(timeout=60)
    if "Traceback" in printed or "Fatal" in printed:
        return "traceback", printed
    if process.returncode == 130 and printed.startswith("error: interrupted") and printed.count("\n") == 1:
        return "one line, 130", printed
    if process.returncode == -signal.SIGINT:
        return "ended by the signal", printed
    return "had ended", printed


def main(arguments: list[str] | None = None) -> int:
    """Send the signals, print the counts and the tracebacks' last lines."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.interrupts", description=__doc__.split("\n")[0])
    parser.add_argument("--signals", type=int, default=200)
    parser.add_argument("--until", type=float, default=250.0, metavar="MS", help="latest time of a signal")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--program", type=Path, default=PROGRAM)
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(arguments)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a program in the background ignores it, as its children do
    rng = np.random.default_rng(options.seed)
    counts: Counter[str] = Counter()
    causes: Counter[str] = Counter()
    for delay_s in rng.uniform(0, options.until / 1000, options.signals):
        outcome, printed = outcome_of(options.program, delay_s)
        counts[outcome] += 1
        if outcome == "traceback":
            causes["Python's own start" if "<frozen site>" in printed else "the installed script"] += 1
    print(f"{options.signals} signals from 0 to {options.until:g} ms after the start, seed {options.seed}")
    for outcome in OUTCOMES:
        print(f"{counts[outcome]:5}  {100 * counts[outcome] / options.signals:5.1f} %  {outcome}")
    print(f"tracebacks: {', '.join(f'{number} of {cause}' for cause, number in causes.most_common()) or 'none'}")
    print(f"load {os.getloadavg()[0]:.1f}; {conditions_text()}")
    if options.json:
        write_json(options.json, {"counts": dict(counts), "seed": options.seed, "until_ms": options.until})
    return 0


if __name__ == "__main__":
    sys.exit(main())
