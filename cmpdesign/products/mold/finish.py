"""Parts finished: built, checked and written; large molds by two processes at once.

Parts do not depend on each other, and each is written from a fresh document, so its bytes are the same
wherever it is made.
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
from typing import Any

from cmpdesign.design.design import Design
from cmpdesign.errors import CmpDesignError
from cmpdesign.layout.layout import Layout
from cmpdesign.products.mold.parts import Part, make_parts
from cmpdesign.products.mold.solids.measure import drafts_deg, measure_solid
from cmpdesign.products.mold.stack.stack import make_stack
from cmpdesign.products.mold.step.step import NamedSolid, solid_to_step

# The share by which a volume may differ from its formula.
VOLUME_TOLERANCE = 1e-9
# Starting a process and loading the kernel there takes as long as some hundred bosses.
MIN_BOSSES_FOR_TWO = 400

# Names of the parts to finish, of a design and its layout.
FinishTask = tuple[Design, Layout, list[str]]


class MoldError(CmpDesignError):
    """A part did not come out as computed; nothing was written."""


@dataclass(frozen=True)
class FinishedPart:
    """A part's figures as measured on its solid, and its STEP file."""

    figures: dict[str, Any]
    step: bytes


def finish_parts(design: Design, layout: Layout, parts: Sequence[Part]) -> dict[str, FinishedPart]:
    """Every part of a design's mold by name, in order.

    Raises:
        MoldError: see ``finish_part``.
    """
    here, there = _split_work(parts)
    made = (
        _finish_in_two_processes(design, layout, here, there)
        if there
        else [finish_part(part) for part in here]
    )
    by_name = dict(zip([part.name for part in (*here, *there)], made, strict=True))
    return {part.name: by_name[part.name] for part in parts}


def finish_part(part: Part) -> FinishedPart:
    """A part built, checked and written.

    Raises:
        MoldError: a solid that is open, invalid, or of another volume than its closed form.
    """
    # A part keeps its solid; a copy's goes with it, so that only one at a time is in memory.
    part = replace(part)
    return FinishedPart(check_part(part), solid_to_step(NamedSolid(part.name, part.color, part.solid)))


def check_part(part: Part) -> dict[str, Any]:
    """A part's figures as measured on its solid; raises ``MoldError`` as ``finish_part`` does."""
    found = measure_solid(part.solid)
    error = abs(found.volume_mm3 / part.volume_mm3 - 1)
    if not found.valid or not found.closed or error > VOLUME_TOLERANCE:
        state = "closed" if found.closed else "open"
        raise MoldError(
            f"mold: {part.name} came out {'valid' if found.valid else 'invalid'}, {state}, with a "
            f"volume off by {error:.2g} of its own, limit {VOLUME_TOLERANCE:g}; this is a fault of "
            "cmpdesign, please report it"
        )
    drafts = drafts_deg(part.solid, *part.pull_box_mm)
    return {
        "faces": found.faces,
        "volume_mm3": round(found.volume_mm3, 6),
        "draft_min_deg": round(drafts[0], 6) if drafts[0] == drafts[0] else None,
        "draft_max_deg": round(drafts[1], 6) if drafts[1] == drafts[1] else None,
    }


def _split_work(parts: Sequence[Part]) -> tuple[list[Part], list[Part]]:
    """The parts for this process and for a second one, alike in work; none there if it does not pay."""
    if sum(map(_boss_count, parts)) < MIN_BOSSES_FOR_TWO or available_cores() < 2 or not sys.executable:
        return list(parts), []
    here: list[Part] = []
    there: list[Part] = []
    for part in sorted(parts, key=_boss_count, reverse=True):
        lighter = here if sum(map(_boss_count, here)) <= sum(map(_boss_count, there)) else there
        lighter.append(part)
    return here, there


def available_cores() -> int:
    """Those that this process may use, where the system tells."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _boss_count(part: Part) -> int:
    """Bosses or holes, which all work goes with; those of a domed pad's parts are their cells."""
    if part.slab is None:
        return 0
    curved = len(part.stack.cells(part.color_number)) if part.crown in ("plate", "sheet") else 0
    return curved + len(part.slab.many) + len(part.slab.many_through)


def _finish_in_two_processes(
    design: Design, layout: Layout, here: Sequence[Part], there: Sequence[Part]
) -> list[FinishedPart]:
    """The parts finished here, and those that a second process finishes in the meantime."""
    # Not multiprocessing, which would import a caller's script once more.
    command = [sys.executable, "-P", "-c", f"from {__name__} import helper; helper()"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or "." for path in sys.path)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, env=environment) as process:
        assert process.stdin is not None
        try:
            # One that dies at once is heard below.
            with suppress(BrokenPipeError):
                process.stdin.write(_pickle_task((design, layout, [part.name for part in there])))
                process.stdin.flush()
            made = [finish_part(part) for part in here]
            output, errors = process.communicate()
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        raise RuntimeError(f"mold: the second process failed: {errors.decode(errors='replace')}")
    result: list[FinishedPart] | MoldError = pickle.loads(output)
    if isinstance(result, MoldError):
        raise result
    return made + result


def _pickle_task(task: FinishTask) -> bytes:
    """A task as bytes; its layout's palette, a read-only view, goes as a copy."""
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer)
    pickler.dispatch_table = {MappingProxyType: lambda view: (dict, (dict(view),))}
    pickler.dump(task)
    return buffer.getvalue()


def helper() -> None:
    """The second process: a task on standard input, what its parts came to on standard output."""
    output = os.fdopen(os.dup(1), "wb")
    # Whatever the kernel has to say must not come between.
    os.dup2(2, 1)
    result: list[FinishedPart] | MoldError
    try:
        design, layout, names = pickle.load(sys.stdin.buffer)
        parts = {part.name: part for part in make_parts(make_stack(design, layout))}
        result = [finish_part(parts[name]) for name in names]
    except MoldError as error:
        result = error
    with output:
        pickle.dump(result, output)
