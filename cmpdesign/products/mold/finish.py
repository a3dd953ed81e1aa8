"""Parts built, checked and formatted as STEP.

Parts do not depend on each other, and each part has its own document, so its bytes are the same in every process.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from cmpdesign.design.design import Design
from cmpdesign.errors import CmpDesignError
from cmpdesign.layout.layout import Layout
from cmpdesign.products.mold.parts import Part, make_parts
from cmpdesign.products.mold.processes import results_of_parts
from cmpdesign.products.mold.solids.measure import drafts_deg, measure_solid
from cmpdesign.products.mold.stack.stack import make_stack
from cmpdesign.products.mold.step.step import NamedSolid, solid_to_step

# Largest relative difference of a volume from its closed form.
VOLUME_TOLERANCE = 1e-9


class MoldError(CmpDesignError):
    """A solid or mesh of a part differs from the computed figures; no file was written."""


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
    return results_of_parts(f"{__name__}:finish_named_parts", design, layout, parts)


def finish_named_parts(design: Design, layout: Layout, names: Sequence[str]) -> Iterator[FinishedPart]:
    """``finish_parts`` in this process, for the parts of these names, one after the other."""
    parts = {part.name: part for part in make_parts(make_stack(design, layout))}
    for name in names:
        yield finish_part(parts[name])


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
            f"mold: the solid of {part.name} is {'valid' if measures.valid else 'invalid'}, {state}, with a "
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
