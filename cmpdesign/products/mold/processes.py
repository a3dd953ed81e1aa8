"""Work with the CAD kernel in separate processes, which can be ended in the middle of a kernel's call.

A call into the kernel may take seconds and lets no other Python code run, so Ctrl-C in the kernel's own process would
wait for its end. Parts do not depend on each other, so large molds are made by two processes at once.
"""

from __future__ import annotations

import io
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from importlib import import_module
from queue import SimpleQueue
from tempfile import TemporaryFile
from threading import Thread
from types import MappingProxyType
from typing import IO, Any, NamedTuple

from cmpdesign.design.design import Design
from cmpdesign.errors import CmpDesignError
from cmpdesign.layout.layout import Layout
from cmpdesign.products.mold.parts import Part
from cmpdesign.watch import tell, told

# Starting a process and loading the kernel takes as long as some hundred bosses.
MIN_BOSSES_FOR_TWO = 400


class PartsTask(NamedTuple):
    """The function ("module:name") of a design, its layout and names of parts to their results, and its arguments."""

    function: str
    design: Design
    layout: Layout
    names: list[str]


def results_of_parts(function: str, design: Design, layout: Layout, parts: Sequence[Part]) -> dict[str, Any]:
    """Call a function for the parts of a design, in one or two processes.

    Args:
        function: "module:name" of a function that takes a design, its layout and names of parts, and yields one
            picklable result a part.
        design: the design.
        layout: its layout.
        parts: the parts.

    Returns:
        The results by the parts' names, in the order of ``parts``.

    Raises:
        CmpDesignError: the error of the function.
        ModuleNotFoundError: the kernel is not installed.
    """
    if not sys.executable:  # an embedded interpreter
        module, _, name = function.partition(":")
        names = [part.name for part in parts]
        made = getattr(import_module(module), name)(design, layout, names)
        return dict(zip(names, told(made, len(names)), strict=True))
    groups = [[part.name for part in group] for group in _split_work(parts) if group]
    results = _run([PartsTask(function, design, layout, group) for group in groups])
    by_name = {
        name: result
        for group, own in zip(groups, results, strict=True)
        for name, result in zip(group, own, strict=True)
    }
    return {part.name: by_name[part.name] for part in parts}


def available_cores() -> int:
    """The number of cores that this process may use; all cores if the system does not state it."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _split_work(parts: Sequence[Part]) -> tuple[list[Part], list[Part]]:
    """The parts for two processes, balanced by work; all for the first if the mold is small."""
    if sum(map(_boss_count, parts)) < MIN_BOSSES_FOR_TWO or available_cores() < 2:
        return list(parts), []
    first: list[Part] = []
    second: list[Part] = []
    for part in sorted(parts, key=_boss_count, reverse=True):
        lighter = first if sum(map(_boss_count, first)) <= sum(map(_boss_count, second)) else second
        lighter.append(part)
    return first, second


def _boss_count(part: Part) -> int:
    """The number of bosses or holes, a measure of the work; for dished parts the number of cells."""
    if part.slab is None:
        return 0
    curved = len(part.stack.cells(part.color_number)) if part.crown in ("plate", "sheet") else 0
    return curved + len(part.slab.many) + len(part.slab.many_through)


class _Message(NamedTuple):
    """A message of a process: the process' number, and a result, an error or ``_END``."""

    process: int
    content: Any


_END = object()


def _run(tasks: Sequence[PartsTask]) -> list[list[Any]]:
    """The results of every task, each from a separate process; in every case, all processes have ended at the
    return.
    """
    messages: SimpleQueue[_Message] = SimpleQueue()
    with ExitStack() as stack:
        errors = [stack.enter_context(TemporaryFile()) for _ in tasks]
        processes = [_start(stack, error, messages, number) for number, error in enumerate(errors)]
        for process, task in zip(processes, tasks, strict=True):
            assert process.stdin is not None
            # A process that ends at once is reported below.
            with suppress(BrokenPipeError), process.stdin as stream:
                stream.write(_pickle_task(task))
        return _collect(tasks, messages, errors)


def _start(
    stack: ExitStack, errors: IO[bytes], messages: SimpleQueue[_Message], number: int
) -> subprocess.Popen[bytes]:
    """Start a process that is killed at the end of the stack, and a thread that forwards the process' messages."""
    # multiprocessing is not used, because it would import the caller's script again.
    command = [sys.executable, "-P", "-c", f"from {__name__} import helper; helper()"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or "." for path in sys.path)}
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=errors, env=environment)
    forwarder = Thread(target=_forward, args=(process, messages, number), daemon=True)

    def end() -> None:
        process.kill()
        process.wait()
        forwarder.join()
        for stream in (process.stdin, process.stdout):
            assert stream is not None
            with suppress(BrokenPipeError):
                stream.close()

    stack.callback(end)
    forwarder.start()
    return process


def _forward(process: subprocess.Popen[bytes], messages: SimpleQueue[_Message], number: int) -> None:
    assert process.stdout is not None
    # A stream that breaks off in a result is an early end, too.
    with suppress(EOFError, pickle.UnpicklingError):
        while True:
            messages.put(_Message(number, pickle.load(process.stdout)))
    messages.put(_Message(number, _END))


def _collect(
    tasks: Sequence[PartsTask], messages: SimpleQueue[_Message], errors: Sequence[IO[bytes]]
) -> list[list[Any]]:
    """The results of every task in its order.

    Raises:
        CmpDesignError, ModuleNotFoundError: the error of a process.
        RuntimeError: a process ended early; with its standard error.
    """
    results: list[list[Any]] = [[] for _ in tasks]
    total = sum(len(task.names) for task in tasks)
    running = len(tasks)
    while running:
        number, content = messages.get()
        if isinstance(content, BaseException):
            raise content
        if content is not _END:
            results[number].append(content)
            tell(sum(map(len, results)), total)
            continue
        running -= 1
        if len(results[number]) < len(tasks[number].names):
            errors[number].seek(0)
            raise RuntimeError(f"mold: a process failed: {errors[number].read().decode(errors='replace')}")
    return results


def _pickle_task(task: PartsTask) -> bytes:
    """Pickle a task; the layout's palette, a read-only view, is pickled as a copy."""
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer)
    pickler.dispatch_table = {MappingProxyType: lambda view: (dict, (dict(view),))}
    pickler.dump(task)
    return buffer.getvalue()


def helper() -> None:
    """One of the processes: reads a pickled task from standard input, writes pickled results to standard output."""
    # Ctrl-C reaches all processes of a terminal; the waiting process ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    output = os.fdopen(os.dup(1), "wb")
    # Messages of the kernel go to standard error.
    os.dup2(2, 1)
    with output:
        try:
            task: PartsTask = pickle.load(sys.stdin.buffer)
            module, _, name = task.function.partition(":")
            for result in getattr(import_module(module), name)(task.design, task.layout, task.names):
                pickle.dump(result, output)
                output.flush()
        except (CmpDesignError, ModuleNotFoundError) as error:
            pickle.dump(error, output)
