"""Parts built, checked and formatted as STEP; large molds by two processes at once.

Parts do not depend on each other, and each part has its own document, so its bytes are the same in both processes.
"""

from __future__ import annotations

import io
import os
import pickle
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

from cmpdesign.design.design import Design
from cmpdesign.errors import CmpDesignError
from cmpdesign.layout.layout import Layout
from cmpdesign.products.mold.parts import Part, make_parts
from cmpdesign.products.mold.solids.measure import drafts_deg, measure_solid
from cmpdesign.products.mold.stack.stack import make_stack
from cmpdesign.products.mold.step.step import NamedSolid, solid_to_step

# Largest relative difference of a volume from its closed form.
VOLUME_TOLERANCE = 1e-9
# Starting a process and loading the kernel in it takes as long as some hundred bosses.
MIN_BOSSES_FOR_TWO = 400


class FinishTask(NamedTuple):
    """Names of the parts to finish, of a design and its layout."""

    design: Design
    layout: Layout
    names: list[str]


class MoldError(CmpDesignError):
    """A solid or mesh of a part is not as computed; no file was written."""


@dataclass(frozen=True)
class FinishedPart:
    """The figures of a part, measured on its solid, and the bytes of its STEP file."""

    figures: dict[str, Any]
    step_file: bytes


def finish_parts(design: Design, layout: Layout, parts: Sequence[Part]) -> dict[str, FinishedPart]:
    """Build, check and format the parts of a design's mold.

    Returns:
        The finished parts by name, in the order of ``parts``.

    Raises:
        MoldError: see ``finish_part``.
    """
    own, delegated = _split_work(parts)
    finished = (
        _finish_in_two_processes(design, layout, own, delegated)
        if delegated
        else [finish_part(part) for part in own]
    )
    by_name = dict(zip([part.name for part in (*own, *delegated)], finished, strict=True))
    return {part.name: by_name[part.name] for part in parts}


def finish_part(part: Part) -> FinishedPart:
    """Build, check and format one part.

    Raises:
        MoldError: the solid is open, invalid, or of another volume than its closed form.
    """
    # A part keeps its solid. The copy's solid is freed with the copy, so that only one solid is in memory.
    part = replace(part)
    return FinishedPart(check_part(part), solid_to_step(NamedSolid(part.name, part.color, part.solid)))


def check_part(part: Part) -> dict[str, Any]:
    """Measure the solid of a part; the figures for the report.

    Raises:
        MoldError: see ``finish_part``.
    """
    measures = measure_solid(part.solid)
    error = abs(measures.volume_mm3 / part.volume_mm3 - 1)
    if not measures.valid or not measures.closed or error > VOLUME_TOLERANCE:
        state = "closed" if measures.closed else "open"
        raise MoldError(
            f"mold: {part.name} came out {'valid' if measures.valid else 'invalid'}, {state}, with a "
            f"volume off by {error:.2g} of its own, limit {VOLUME_TOLERANCE:g}; this is a fault of "
            "cmpdesign, please report it"
        )
    drafts = drafts_deg(part.solid, *part.pull_box_mm)
    return {
        "faces": measures.faces,
        "volume_mm3": round(measures.volume_mm3, 6),
        "draft_min_deg": round(drafts[0], 6) if drafts[0] == drafts[0] else None,
        "draft_max_deg": round(drafts[1], 6) if drafts[1] == drafts[1] else None,
    }


def _split_work(parts: Sequence[Part]) -> tuple[list[Part], list[Part]]:
    """The parts for this process and for a second process, balanced by work; all here if the mold is small."""
    if sum(map(_boss_count, parts)) < MIN_BOSSES_FOR_TWO or available_cores() < 2 or not sys.executable:
        return list(parts), []
    own: list[Part] = []
    delegated: list[Part] = []
    for part in sorted(parts, key=_boss_count, reverse=True):
        lighter = own if sum(map(_boss_count, own)) <= sum(map(_boss_count, delegated)) else delegated
        lighter.append(part)
    return own, delegated


def available_cores() -> int:
    """The number of cores that this process may use; all cores if the system does not state it."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _boss_count(part: Part) -> int:
    """The number of bosses or holes, a measure of the work; for dished parts the number of cells."""
    if part.slab is None:
        return 0
    curved = len(part.stack.cells(part.color_number)) if part.crown in ("plate", "sheet") else 0
    return curved + len(part.slab.many) + len(part.slab.many_through)


def _finish_in_two_processes(
    design: Design, layout: Layout, own: Sequence[Part], delegated: Sequence[Part]
) -> list[FinishedPart]:
    """The finished own parts, then the delegated parts, which a second process finishes at the same time."""
    # multiprocessing is not used, because it would import the caller's script again.
    command = [sys.executable, "-P", "-c", f"from {__name__} import helper; helper()"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or "." for path in sys.path)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, env=environment) as process:
        assert process.stdin is not None
        try:
            # The return code below reports a process that ends at once.
            with suppress(BrokenPipeError):
                task = FinishTask(design, layout, [part.name for part in delegated])
                process.stdin.write(_pickle_task(task))
                process.stdin.flush()
            finished = [finish_part(part) for part in own]
            output, errors = process.communicate()
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        raise RuntimeError(f"mold: the second process failed: {errors.decode(errors='replace')}")
    result: list[FinishedPart] | MoldError = pickle.loads(output)
    if isinstance(result, MoldError):
        raise result
    return finished + result


def _pickle_task(task: FinishTask) -> bytes:
    """Pickle a task; the layout's palette, a read-only view, is pickled as a copy."""
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer)
    pickler.dispatch_table = {MappingProxyType: lambda view: (dict, (dict(view),))}
    pickler.dump(task)
    return buffer.getvalue()


def helper() -> None:
    """The second process: reads a pickled task from standard input, writes the pickled result to standard output."""
    output = os.fdopen(os.dup(1), "wb")
    # Messages of the kernel go to standard error.
    os.dup2(2, 1)
    result: list[FinishedPart] | MoldError
    try:
        task: FinishTask = pickle.load(sys.stdin.buffer)
        parts = {part.name: part for part in make_parts(make_stack(task.design, task.layout))}
        result = [finish_part(parts[name]) for name in task.names]
    except MoldError as error:
        result = error
    with output:
        pickle.dump(result, output)
