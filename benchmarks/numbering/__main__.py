"""Two methods of numbering the cells of the same images: the article's, and the extractor's.

The article finds cells by hue and AGA, and numbers a graph of corners. The extractor finds cells by contrast, and
registers the parts of a mesh of cells. A cell is right if it gets the layout's number, and wrong if it gets another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.article.corners import fit_plain_triangles
from benchmarks.suites.article.graph import connect_corners
from benchmarks.suites.article.numbering import make_lattice_tables as article_lattice
from benchmarks.suites.article.numbering import number_triangles as article_number
from benchmarks.suites.article.regions import grow_from_hues
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import (
    Camera,
    Damage,
    Optics,
    Press,
    Scene,
    Scratch,
    Sensor,
    Surface,
    Truth,
    Twist,
    render,
    standard_layout,
    standard_scene,
)
from extractor import Extractor, parse_layout
from extractor.layout.reference import Reference
from extractor.pipeline import ImageReader

PATTERNS = ("honeycomb", "round", "elliptical")
SEEDS = (1, 2, 3)
LAYERS = 10


@dataclass(frozen=True)
class NumberingCondition:
    """One kind of image; ``pitch_px``, ``blur_px`` in px of the image, ``noise`` in 8-bit units."""

    name: str
    damage: Damage | None = None
    surface: Surface | None = None
    pitch_px: float = 20.0
    tilt_deg: float = 0.0
    blur_px: float = 1.0
    noise: float = 2.0


CONDITIONS = (
    NumberingCondition("plain"),
    *(
        NumberingCondition(f"{share:.0%} of the cells missing", Damage(missing_share=share))
        for share in (0.01, 0.05, 0.1, 0.2)
    ),
    NumberingCondition(
        "a scratch, half an edge wide", Damage(scratches=(Scratch((-20.0, 3.0), (20.0, 6.0), 0.75),))
    ),
    NumberingCondition(
        "a scratch, an edge wide", Damage(scratches=(Scratch((-20.0, 3.0), (20.0, 6.0), 1.5),))
    ),
    NumberingCondition("twist by 30 degrees", surface=Surface((Twist(6.0, 30.0),))),
    NumberingCondition("pinch", surface=Surface((Press(4.0, -1.5),))),
    NumberingCondition("tilt 60 degrees", tilt_deg=60.0),
    NumberingCondition("blur of a tenth of an edge", blur_px=2.0),
    NumberingCondition("blur of a fifth of an edge", blur_px=4.0),
    NumberingCondition("pitch 8 px", pitch_px=8.0),
    NumberingCondition("noise 20/255", noise=20.0),
)


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


def compare_methods(condition: NumberingCondition) -> tuple[CellCount, CellCount]:
    """The counts of the article's method and of the extractor on the same images."""
    article, registered = CellCount(), CellCount()
    inks = standard_scene().inks
    for pattern in PATTERNS:
        layout = standard_layout(pattern, LAYERS)
        reference = parse_layout(layout_to_json(layout))
        extractor, lattice = Extractor(reference), article_lattice(reference)
        reader = ImageReader(reference)
        colored = np.flatnonzero(reference.cell_color < 3)
        for seed in SEEDS:
            scene = Scene(
                layout,
                Camera(pitch_px=condition.pitch_px, rotation_deg=47.0 * seed, tilt_deg=condition.tilt_deg),
                surface=condition.surface,
                optics=Optics(condition.blur_px),
                sensor=Sensor(noise=condition.noise),
                damage=condition.damage,
                inks=inks,
                seed=seed,
            )
            rendered = render(scene)
            image, truth = np.asarray(rendered.image, np.uint8), rendered.truth
            pyramid = reader.pyramid(image)
            assert pyramid is not None
            view = pyramid.level(1)
            triangles = fit_plain_triangles(grow_from_hues(view, dict(reference.palette)))
            numbering = article_number(image, triangles, connect_corners(triangles), lattice)
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
    for condition in CONDITIONS:
        article, registered = compare_methods(condition)
        counts = [(100 * one.right / one.visible, one.wrong) for one in (article, registered)]
        rows.append((condition.name, article.visible, *counts[0], *counts[1]))
    columns = {"condition": TEXT, "visible": "d", "article: right %": ".2f", "article: wrong": "d"}
    columns |= {"registered: right %": ".2f", "registered: wrong": "d"}
    title = f"cells numbered, {len(PATTERNS)} patterns x {len(SEEDS)} images, {LAYERS} layers"
    yield Table(title, columns, rows)


main = Experiment("numbering", measure)

if __name__ == "__main__":
    raise SystemExit(main())
