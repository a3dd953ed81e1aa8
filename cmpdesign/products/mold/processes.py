"""Work with the CAD kernel in processes of its own: such a process can be ended in the middle of a kernel's call.

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
from contextlib import suppress
from importlib import import_module
from types import MappingProxyType
from typing import Any, NamedTuple

from cmpdesign.design.design import Design
from cmpdesign.errors import CmpDesignError
from cmpdesign.layout.layout import Layout
from cmpdesign.products.mold.parts import Part

# Starting a process and loading the kernel in it takes as long as some hundred bosses.
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
        function: "module:name" of a function that takes a design, its layout and names of parts, and returns a list
            of one picklable result a part.
        design: the design.
        layout: its layout.
        parts: the parts.

    Returns:
        The results by the parts' names, in the order of ``parts``.

    Raises:
        CmpDesignError: as the function raised it.
        ModuleNotFoundError: the kernel is not installed.
    """
    if not sys.executable:  # an embedded interpreter
        module, _, name = function.partition(":")
        names = [part.name for part in parts]
        return dict(zip(names, getattr(import_module(module), name)(design, layout, names), strict=True))
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


def _run(tasks: Sequence[PartsTask]) -> list[Any]:
    """The result of every task, each from its own process; all processes have ended, whatever happens."""
    # multiprocessing is not used, because it would import the caller's script again.
    command = [sys.executable, "-P", "-c", f"from {__name__} import helper; helper()"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or "." for path in sys.path)}
    pipe = subprocess.PIPE
    processes: list[subprocess.Popen[bytes]] = []
    try:
        for task in tasks:
            process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, env=environment)
            processes.append(process)
            assert process.stdin is not None
            # The return code below reports a process that ends at once.
            with suppress(BrokenPipeError):
                process.stdin.write(_pickle_task(task))
                process.stdin.flush()
        return [_result_of(process) for process in processes]
    finally:
        for process in processes:
            process.kill()
            with process:
                pass


def _result_of(process: subprocess.Popen[bytes]) -> Any:
    output, errors = process.communicate()
    if process.returncode:
        raise RuntimeError(f"mold: a process failed: {errors.decode(errors='replace')}")
    result = pickle.loads(output)
    if isinstance(result, BaseException):
        raise result
    return result


def _pickle_task(task: PartsTask) -> bytes:
    """Pickle a task; the layout's palette, a read-only view, is pickled as a copy."""
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer)
    pickler.dispatch_table = {MappingProxyType: lambda view: (dict, (dict(view),))}
    pickler.dump(task)
    return buffer.getvalue()


def helper() -> None:
    """One of the processes: reads a pickled task from standard input, writes the pickled result to standard output."""
    # Ctrl-C reaches all processes of a terminal; the process that waits ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    output = os.fdopen(os.dup(1), "wb")
    # Messages of the kernel go to standard error.
    os.dup2(2, 1)
    result: Any
    try:
        task: PartsTask = pickle.load(sys.stdin.buffer)
        module, _, name = task.function.partition(":")
        result = getattr(import_module(module), name)(task.design, task.layout, task.names)
    except (CmpDesignError, ModuleNotFoundError) as error:
        result = error
    with output:
        pickle.dump(result, output)
