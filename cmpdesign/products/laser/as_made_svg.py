"""as-made.svg: the pattern as the laser leaves it and the inks fill it, true to size, at the front.

It is drawn like ``pattern.svg``, so that it can be compared, rendered and read by the extractor.
"""

from __future__ import annotations

from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.laser.as_made import burnt_cells
from cmpdesign.products.laser.formats.palette import number
from cmpdesign.products.laser.job import Job
from cmpdesign.products.laser.paths.beam import Points

# Every fourth point of the corners' arcs: chords stay within 2 micrometres of a curve of 0.125 mm radius.
THINNED = 4


def as_made_svg(job: Job) -> str:
    """One group a pass, filled with its ink, over the black ground; y down from the outline's top."""
    low, high = job.outline_mm.min(axis=0), job.outline_mm.max(axis=0)
    width, height = (high - low).tolist()
    lines = [
        '<?xml version="1.0" encoding="utf-8" ?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" version="1.1" width="{number(width)}mm" '
        f'height="{number(height)}mm" viewBox="0 0 {number(width)} {number(height)}">',
        _group("black", job.layout.palette[COLORS[BLACK]], [job.outline_mm], low[0], high[1]),
    ]
    for one in job.cell_passes:
        assert one.color is not None
        outlines = list(burnt_cells(one, job.front)[:, ::THINNED])
        lines.append(_group(one.name, job.layout.palette[COLORS[one.color]], outlines, low[0], high[1]))
    return "\n".join([*lines, "</svg>", ""])


def _group(name: str, ink: str, polygons: list[Points], left: float, top: float) -> str:
    paths = []
    for polygon in polygons:
        points = [f"{number(x - left)} {number(top - y)}" for x, y in polygon.tolist()]
        paths.append(f'<path d="M{"L".join(points)}Z"/>')
    return f'<g id="{name}" fill="{ink}">{"".join(paths)}</g>'
