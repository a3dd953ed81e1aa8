"""Ctrl-C while the program starts: what a user sees, by the time of the signal.

Starts the installed script ``cmpdesign`` of this environment again and again, sends SIGINT after a processor time that
is drawn uniformly (on an idle machine: the time since the start), and counts what comes of it. Needs Linux.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.table import TEXT, Table

OUTCOMES = (
    "one line, exit code 130",
    "ended by the signal, without a word",
    "traceback of Python's own start",
    "traceback of the installed script",
    "had ended",
)
POLL_S = 0.0005


def processor_s(pid: int) -> float:
    """Time that a process has run on a processor; infinite if it has ended."""
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[0]) / 1e9
    except OSError:
        return float("inf")


def outcome_of(program: Path, delay_s: float) -> str:
    """What a signal after this processor time does."""
    process = subprocess.Popen(
        [program, "templates"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    while process.poll() is None and processor_s(process.pid) < delay_s:
        time.sleep(POLL_S)
    process.send_signal(signal.SIGINT)
    _, printed = process.communicate(timeout=60)
    if "Traceback" in printed or "Fatal" in printed:
        return OUTCOMES[2] if "<frozen site>" in printed else OUTCOMES[3]
    if process.returncode == 130 and printed.startswith("error: interrupted") and printed.count("\n") == 1:
        return OUTCOMES[0]
    return OUTCOMES[1] if process.returncode == -signal.SIGINT else OUTCOMES[4]


def measure(signals: int = 200, until_ms: float = 250.0, seed: int = 1, quick: bool = False) -> Shown:
    """Signals while the program starts.

    Args:
        signals: starts of the program, one signal each.
        until_ms: latest time of a signal.
        seed: of the times.
        quick: 10 signals.
    """
    # a process in the background ignores SIGINT, and so do those that it starts
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)
    delays_s = np.random.default_rng(seed).uniform(0, until_ms / 1000, 10 if quick else signals)
    program = Path(sys.executable).with_name("cmpdesign")
    try:
        counts = Counter(outcome_of(program, float(delay_s)) for delay_s in delays_s)
    finally:
        signal.signal(signal.SIGINT, earlier)
    rows = [(outcome, counts[outcome], 100 * counts[outcome] / len(delays_s)) for outcome in OUTCOMES]
    columns = {"outcome": TEXT, "signals": "d", "%": ".1f"}
    yield Table(f"Ctrl-C up to {until_ms:g} ms after the start", columns, rows)
    return Found()


main = Experiment("interrupts", measure)
main.run_as(__name__)
