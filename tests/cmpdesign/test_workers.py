"""Workers end with the process that started them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from cmpdesign.workers import worker_pool

PARENT = """
import os, sys, time
sys.path.insert(0, sys.argv[1])
from cmpdesign.workers import worker_pool

if __name__ == "__main__":
    with worker_pool(2) as pool:
        print(*{pool.submit(os.getpid).result() for _ in range(20)}, flush=True)
        pool.submit(time.sleep, 60)
        time.sleep(60)
"""


def is_gone(process: int, within_s: float = 10) -> bool:
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.skipif(sys.platform == "win32", reason="processes are looked up by signals")
def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    program = tmp_path / "parent.py"
    program.write_text(PARENT, encoding="utf-8")
    command = [sys.executable, str(program), str(Path(__file__).parents[2])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        workers = [int(word) for word in parent.stdout.readline().split()]
        assert workers and not any(is_gone(worker, 0.1) for worker in workers)
        parent.send_signal(signal.SIGKILL)
    try:
        assert all(is_gone(worker) for worker in workers)
    finally:
        for worker in workers:
            with suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)


def test_workers_end_at_once_after_an_error() -> None:
    started = time.monotonic()
    worker = 0
    with pytest.raises(RuntimeError, match="enough"), worker_pool(1) as pool:
        worker = pool.submit(os.getpid).result()
        pool.submit(time.sleep, 60)
        raise RuntimeError("enough")
    assert time.monotonic() - started < 30
    assert sys.platform == "win32" or is_gone(worker)
