"""The extractor: from an image to numbered markers, stage by stage, each timed."""

from __future__ import annotations

import time
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cell_mesh import build_mesh
from extractor.cells.cells import Cells, find_cells, with_triangles
from extractor.cells.region_growing import grow
from extractor.cells.seeds import NO_CROWD, Seeds, find_seeds, large_enough
from extractor.cells.triangle_fit import fit_triangles, rough_triangles
from extractor.complete.repair import repair
from extractor.complete.virtual_markers import place_virtual
from extractor.errors import LayoutError
from extractor.image.color import nominal_hues_deg, to_colors
from extractor.image.ink_segmentation import segment
from extractor.image.input import prepare
from extractor.image.pyramid import Sights
from extractor.image.target_area import find_target
from extractor.layout.lattice_tables import lattice_of
from extractor.layout.reference import Reference
from extractor.layout.topology import topology_of
from extractor.numbering.gaps.detached_cells import attach
from extractor.numbering.lattice_walk import Numbering, number
from extractor.numbering.marker_places import Places, place
from extractor.numbering.missed_cells import missed
from extractor.numbering.small_pattern import amid, outlined
from extractor.presets import PRESETS, Preset
from extractor.refine.estimate import Seen
from extractor.refine.refiner import Refiner
from extractor.result import Markers, Origin, Reason

WORK_PIXELS = 64_000  # of the smallest reduced scale, at which recognition is tried first
MAX_MISSED = 0.01  # of the pattern's cells that a reduced scale may miss
CROWD = 3  # times as many domains as the pattern has cells, and at least
MIN_CROWD = 1000  # so many are not a pattern's alone
MIN_FACES = 4  # markers and black cells between three inks, below which there is no pattern


class Found(NamedTuple):
    """The cells of an image with their numbers."""

    cells: Cells
    numbering: Numbering


def _scales(image: NDArray[np.uint8]) -> list[int]:
    """By how much to reduce an image, one try after the other."""
    scale = max(1, int(np.sqrt(image.shape[0] * image.shape[1] / WORK_PIXELS)))
    return [scale >> i for i in range(scale.bit_length())]


class Stages:
    """Runs stage after stage, keeping each one's result and time."""

    def __init__(self) -> None:
        self.results: dict[str, Any] = {}
        self.timings_ms: dict[str, float] = {}
        self._last = time.perf_counter()

    def done(self, name: str, result: Any) -> Any:
        """Book the time since the stage before under ``name`` and hand the result on."""
        now = time.perf_counter()
        self.timings_ms[name] = self.timings_ms.get(name, 0.0) + 1e3 * (now - self._last)
        self.results[name] = result
        self._last = time.perf_counter()
        return result


class Extractor:
    """Finds and numbers the markers of one layout in images.

    >>> from extractor import Extractor, load_layout
    >>> markers = Extractor(load_layout("layout.json")).extract(image)  # doctest: +SKIP

    Raises:
        LayoutError: the layout is not a triangular pattern.
    """

    def __init__(self, layout: Reference, preset: Preset = "balanced") -> None:
        if layout.cell_corners.shape[1] != 3:
            raise LayoutError(
                f"pattern {layout.pattern!r} has no triangles; honeycomb, round or elliptical can be read"
            )
        self.layout = layout
        if preset not in PRESETS:
            raise ValueError(f"preset is {preset!r}; give one of {', '.join(PRESETS)}")
        self._lattice = lattice_of(layout)
        self._mesh = topology_of(layout)
        self._crowd = max(CROWD * len(self._lattice.ink), MIN_CROWD)
        self._refine = Refiner(self._mesh, preset, layout.virtual_per_edge)
        self._nominal_hues_deg = nominal_hues_deg(dict(layout.palette))

    def extract(self, image: NDArray[Any]) -> Markers:
        """The markers in one image, found without any knowledge of other frames.

        Args:
            image: (H, W, 3) uint8 BGR; also uint16 (scaled to 8 bits), BGRA (alpha dropped) and grayscale (which has
                no color to read: nothing is found, for the reason ``NO_COLOR``). Need not be contiguous.

        Raises:
            ImageError: another dtype or shape, or a side below 16 px.
        """
        stages = Stages()
        bgr = stages.done("image", prepare(image))
        if bgr is None:
            return self._nothing(Reason.NO_COLOR, stages)
        reason, sights = Reason.NO_COLOR, Sights(bgr)
        for scale in _scales(bgr):
            found = self._number(sights, scale, stages)
            if isinstance(found, Found) and (scale == 1 or self._whole(bgr, found, scale, stages)):
                return self._measure(sights, found, stages)
            reason = found if isinstance(found, Reason) else reason
        return self._nothing(reason, stages)

    def _number(self, sights: Sights, scale: int, stages: Stages) -> Found | Reason:
        """Stages 1 to 7 at 1/``scale`` of the image's scale, or why they do not number anything."""
        seeds = self._find(sights, scale, stages)
        if seeds is None:
            return Reason.NO_COLOR
        if scale > 1 and not large_enough(seeds):
            return self._amid(sights, seeds, scale, stages) or Reason.NO_COLOR
        regions = stages.done("grow", grow(stages.results["segment"], seeds))
        triangles = stages.done("triangles", fit_triangles(sights.at(1).image, regions, scale))
        cells = stages.done("cells", find_cells(seeds, triangles, scale))
        return self._connect(sights, cells, stages)

    def _amid(self, sights: Sights, seeds: Seeds, scale: int, stages: Stages) -> Found | None:
        """The whole pattern by the centers of its cells, where these are too small at this scale for more."""
        if not amid(seeds, len(self._lattice.ink)):
            return None
        rough = stages.done("triangles", rough_triangles(seeds, scale))
        cells = stages.done("cells", find_cells(seeds, rough, scale))
        found = self._connect(sights, cells, stages)
        if not isinstance(found, Found):
            return None
        triangles = outlined(sights.at(1).image, cells, found.numbering, self._lattice)
        if triangles is None:
            return None
        stages.done("triangles", triangles)
        return Found(stages.done("cells", with_triangles(cells, triangles)), found.numbering)

    def _connect(self, sights: Sights, cells: Cells, stages: Stages) -> Found | Reason:
        """Stages 6 and 7."""
        bgr = sights.at(1).image
        mesh = stages.done("mesh", build_mesh(cells))
        if mesh is None or int((mesh.turn != 0).sum()) < min(MIN_FACES, self._lattice.layers**2):
            return Reason.NO_PATTERN
        numbering = stages.done("number", number(bgr, cells, mesh, self._lattice))
        if numbering is None:
            return Reason.REFERENCE_LOST
        if not numbering.ambiguous:
            numbering = stages.done("attach", attach(cells, numbering, self._lattice))
        return Reason.AMBIGUOUS if numbering.ambiguous else Found(cells, numbering)

    def _whole(self, bgr: NDArray[np.uint8], found: Found, scale: int, stages: Stages) -> bool:
        """Whether a finer scale would number no more cells than have been numbered."""
        count = stages.done("missed", missed(bgr, found.cells, found.numbering, self._lattice, scale))
        return int(count) <= MAX_MISSED * len(self._lattice.ink)

    def _find(self, sights: Sights, scale: int, stages: Stages) -> Seeds | None:
        """Stages 1 to 3; None where an ink is absent."""
        colors = stages.done("color", to_colors(sights.at(scale).image))
        target = stages.done("target", find_target(colors))
        segmentation = stages.done("segment", segment(colors, target, self._nominal_hues_deg))
        if segmentation is None:
            return None
        # at a reduced scale, a crowd is what another scale may tell
        crowd = self._crowd if scale == 1 else NO_CROWD
        return stages.done("seeds", find_seeds(segmentation, crowd))  # type: ignore[no-any-return]

    def _measure(self, sights: Sights, found: Found, stages: Stages) -> Markers:
        """The places of what has been numbered, and what follows from them."""
        cells, numbering = found
        places = stages.done("place", place(cells, numbering, self._lattice, sights.size))
        return self.finish(sights, places, numbering.mirrored, numbering.origin, stages)

    def finish(
        self,
        sights: Sights,
        places: Places,
        mirrored: bool,
        origin: Origin,
        stages: Stages,
        before: Seen | None = None,
    ) -> Markers:
        """Refinement, repair and virtual markers: the same for every way to a numbering."""
        refined = stages.done("refine", self._refine(sights, places, before))
        repaired = stages.done("repair", repair(refined, places, self._lattice, sights.size))
        virtual = stages.done("virtual", place_virtual(self._mesh, repaired, refined.points))
        return Markers(
            xy_px=repaired.xy_px,
            cov_px2=repaired.cov_px2,
            status=repaired.status,
            virtual_xy_px=virtual.xy_px,
            virtual_cov_px2=virtual.cov_px2,
            virtual_status=virtual.status,
            mirrored=mirrored,
            origin=origin,
            reason=None,
            timings_ms=MappingProxyType(stages.timings_ms),
            stages=MappingProxyType(stages.results),
        )

    def _nothing(self, reason: Reason, stages: Stages) -> Markers:
        markers, edges, count = len(self.layout.layer), len(self.layout.edges), self.layout.virtual_per_edge
        return Markers(
            xy_px=np.full((markers, 2), np.nan),
            cov_px2=np.full((markers, 2, 2), np.nan),
            status=np.zeros(markers, np.uint8),
            virtual_xy_px=np.full((edges, count, 2), np.nan),
            virtual_cov_px2=np.full((edges, count, 2, 2), np.nan),
            virtual_status=np.zeros((edges, count), np.uint8),
            mirrored=None,
            reason=reason,
            timings_ms=MappingProxyType(stages.timings_ms),
            stages=MappingProxyType(stages.results),
        )
