"""Two methods of numbering the cells of the same images: the article's, and the extractor's.

The article finds cells by hue and AGA, and numbers a graph of corners. The extractor finds cells by contrast, and
registers the parts of a mesh of cells. A cell is right if it gets the layout's number, and wrong if it gets another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.article.method import ArticleReader
from benchmarks.suites.stress.frames import PATTERNS, PatternFrame
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import (
    Camera,
    Optics,
    Press,
    Scene,
    Scratch,
    Sensor,
    Truth,
    Twist,
    render,
    standard_layout,
)
from cmpdesign.scene.standard import INKS
from extractor import Extractor, parse_layout
from extractor.layout.reference import Reference

SEEDS = (1, 2, 3)
LAYERS = 10
Change = Callable[[PatternFrame], PatternFrame]


def scratched(width_mm: float) -> Change:
    """A scratch across the pattern."""
    return lambda frame: frame.damaged(scratches=(Scratch((-20.0, 3.0), (20.0, 6.0), width_mm),))


CONDITIONS: dict[str, Change] = {
    "plain": lambda frame: frame,
    "1% of the cells missing": lambda frame: frame.damaged(missing_share=0.01),
    "5% of the cells missing": lambda frame: frame.damaged(missing_share=0.05),
    "10% of the cells missing": lambda frame: frame.damaged(missing_share=0.1),
    "20% of the cells missing": lambda frame: frame.damaged(missing_share=0.2),
    "a scratch, half an edge wide": scratched(0.75),
    "a scratch, an edge wide": scratched(1.5),
    "twist by 30 degrees": lambda frame: frame.with_surface(Twist(6.0, 30.0)),
    "pinch": lambda frame: frame.with_surface(Press(4.0, -1.5)),
    "tilt 60 degrees": lambda frame: frame.with_camera(tilt_deg=60.0),
    "blur of a tenth of an edge": lambda frame: frame.blurred(2.0),
    "blur of a fifth of an edge": lambda frame: frame.blurred(4.0),
    "pitch 8 px": lambda frame: frame.with_camera(pitch_px=8.0),
    "noise 20/255": lambda frame: frame.with_sensor(noise=20.0),
}


@dataclass
class CellCount:
    """Cells over all images of a condition."""

    visible: int = 0
    right: int = 0
    wrong: int = 0

    def add(
        self, cell: NDArray[np.int32], centre_px: NDArray[np.float64], reference: Reference, truth: Truth
    ) -> None:
        """Count the numbered cells: each belongs to the layout's cell with the nearest true centre."""
        inked = np.flatnonzero(reference.cell_color < 3)
        true_px = truth.marker_xy_px[reference.cell_corners[inked]].mean(axis=1)
        self.visible += int(truth.cell_visible[inked].sum())
        for found, centre in zip(cell[cell >= 0], centre_px[cell >= 0], strict=True):
            right = inked[np.linalg.norm(true_px - centre, axis=1).argmin()] == found
            # A damaged cell need not be found, but its number must be right too.
            self.right += int(right and truth.cell_visible[found])
            self.wrong += int(not right)


def compare_methods(change: Change) -> tuple[CellCount, CellCount]:
    """The counts of the article's method and of the extractor on the same images."""
    article, registered = CellCount(), CellCount()
    for pattern in PATTERNS:
        layout = standard_layout(pattern, LAYERS)
        reference = parse_layout(layout_to_json(layout))
        extractor, article_reader = Extractor(reference), ArticleReader(reference)
        colored = np.flatnonzero(reference.cell_color < 3)
        for seed in SEEDS:
            camera = Camera(pitch_px=20.0, rotation_deg=47.0 * seed)
            scene = Scene(layout, camera, optics=Optics(1.0), sensor=Sensor(noise=2.0), inks=INKS, seed=seed)
            rendered = render(change(PatternFrame(scene)).scene)
            image, truth = np.asarray(rendered.image, np.uint8), rendered.truth
            triangles, numbering = article_reader.read(image)
            found = np.full(len(triangles.ink), -1) if numbering is None else numbering.cell_of_triangle
            article.add(found, triangles.corner_px.mean(axis=1), reference, truth)
            numbered = extractor.extract(image).stages.get("triangles")
            cells, centre_px = (np.zeros(0, np.int32), np.zeros((0, 2)))
            if numbered is not None:
                cells, centre_px = colored[numbered.cell], numbered.centre_px
            registered.add(cells, centre_px, reference, truth)
    return article, registered


def measure() -> Shown:
    """One row for every condition."""
    rows = []
    for name, change in CONDITIONS.items():
        article, registered = compare_methods(change)
        counts = [(100 * one.right / one.visible, one.wrong) for one in (article, registered)]
        rows.append((name, article.visible, *counts[0], *counts[1]))
    columns = {"condition": TEXT, "visible": "d", "article: right %": ".2f", "article: wrong": "d"}
    columns |= {"registered: right %": ".2f", "registered: wrong": "d"}
    title = f"cells numbered, {len(PATTERNS)} patterns x {len(SEEDS)} images, {LAYERS} layers"
    yield Table(title, columns, rows)


main = Experiment("numbering", measure)
main.run_as(__name__)
