"""The extractor: from an image to numbered markers, stage by stage, each timed."""

from __future__ import annotations

import time
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cell_mesh import build_cell_mesh
from extractor.cells.cells import Cells, cells_with_triangles, find_cells
from extractor.cells.region_growing import grow
from extractor.cells.seeds import NO_DOMAIN_LIMIT, Seeds, find_seeds, has_large_domains
from extractor.cells.triangle_fit import fit_triangles, triangles_from_moments
from extractor.complete.repair import repair_markers
from extractor.complete.virtual_markers import locate_virtual_markers
from extractor.errors import LayoutError
from extractor.image.color import nominal_hues_deg, to_colors
from extractor.image.ink_segmentation import segment
from extractor.image.input import convert_to_bgr
from extractor.image.pyramid import Pyramid
from extractor.image.target_area import find_target
from extractor.layout.lattice_tables import lattice_of
from extractor.layout.reference import Reference
from extractor.layout.topology import topology_of
from extractor.numbering.gaps.detached_cells import number_detached_cells
from extractor.numbering.lattice_walk import Numbering, number_cells
from extractor.numbering.marker_places import InitialMarkers, merge_corners
from extractor.numbering.missed_cells import count_missed_cells
from extractor.numbering.small_pattern import fit_predicted_triangles, is_small_pattern_possible
from extractor.presets import PRESETS, Preset
from extractor.refine.estimate import Appearance
from extractor.refine.refiner import Refiner
from extractor.result import Markers, Origin, Reason

WORK_PIXELS = 64_000  # of the smallest reduced scale, at which recognition is tried first
MAX_MISSED_SHARE = 0.01  # of the pattern's cells that a reduced scale may miss
MAX_DOMAINS_PER_CELL = 3  # times as many domains as the pattern has cells, and at least
MIN_DOMAIN_LIMIT = 1000  # so many are not a pattern's alone
MIN_FACES = 4  # markers and black cells between three inks, below which there is no pattern


class NumberedCells(NamedTuple):
    """The cells of an image with their numbers."""

    cells: Cells
    numbering: Numbering


def _recognition_scales(image: NDArray[np.uint8]) -> list[int]:
    """By how much to reduce an image, one try after the other."""
    scale = max(1, int(np.sqrt(image.shape[0] * image.shape[1] / WORK_PIXELS)))
    return [scale >> i for i in range(scale.bit_length())]


class Stages:
    """Runs stage after stage, keeping each one's result and time."""

    def __init__(self) -> None:
        self.results: dict[str, Any] = {}
        self.timings_ms: dict[str, float] = {}
        self._last = time.perf_counter()

    def record(self, name: str, result: Any) -> Any:
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
        self._domain_limit = max(MAX_DOMAINS_PER_CELL * len(self._lattice.ink), MIN_DOMAIN_LIMIT)
        self._refiner = Refiner(self._mesh, preset, layout.virtual_per_edge)
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
        bgr = stages.record("image", convert_to_bgr(image))
        if bgr is None:
            return self._no_markers(Reason.NO_COLOR, stages)
        reason, sights = Reason.NO_COLOR, Pyramid(bgr)
        for scale in _recognition_scales(bgr):
            found = self._recognise(sights, scale, stages)
            if isinstance(found, NumberedCells) and (
                scale == 1 or self._is_complete(bgr, found, scale, stages)
            ):
                return self._measure_markers(sights, found, stages)
            reason = found if isinstance(found, Reason) else reason
        return self._no_markers(reason, stages)

    def _recognise(self, sights: Pyramid, scale: int, stages: Stages) -> NumberedCells | Reason:
        """Stages 1 to 7 at 1/``scale`` of the image's scale, or why they do not number anything."""
        seeds = self._find(sights, scale, stages)
        if seeds is None:
            return Reason.NO_COLOR
        if scale > 1 and not has_large_domains(seeds):
            return self._number_by_centers(sights, seeds, scale, stages) or Reason.NO_COLOR
        regions = stages.record("grow", grow(stages.results["segment"], seeds))
        triangles = stages.record("triangles", fit_triangles(sights.at(1).image, regions, scale))
        cells = stages.record("cells", find_cells(seeds, triangles, scale))
        return self._number_cells(sights, cells, stages)

    def _number_by_centers(
        self, sights: Pyramid, seeds: Seeds, scale: int, stages: Stages
    ) -> NumberedCells | None:
        """The whole pattern by the centers of its cells, where these are too small at this scale for more."""
        if not is_small_pattern_possible(seeds, len(self._lattice.ink)):
            return None
        rough = stages.record("triangles", triangles_from_moments(seeds, scale))
        cells = stages.record("cells", find_cells(seeds, rough, scale))
        found = self._number_cells(sights, cells, stages)
        if not isinstance(found, NumberedCells):
            return None
        triangles = fit_predicted_triangles(sights.at(1).image, cells, found.numbering, self._lattice)
        if triangles is None:
            return None
        stages.record("triangles", triangles)
        return NumberedCells(stages.record("cells", cells_with_triangles(cells, triangles)), found.numbering)

    def _number_cells(self, sights: Pyramid, cells: Cells, stages: Stages) -> NumberedCells | Reason:
        """Stages 6 and 7."""
        bgr = sights.at(1).image
        mesh = stages.record("mesh", build_cell_mesh(cells))
        if mesh is None or int((mesh.orientation != 0).sum()) < min(MIN_FACES, self._lattice.layers**2):
            return Reason.NO_PATTERN
        numbering = stages.record("number", number_cells(bgr, cells, mesh, self._lattice))
        if numbering is None:
            return Reason.REFERENCE_LOST
        if not numbering.ambiguous:
            numbering = stages.record("attach", number_detached_cells(cells, numbering, self._lattice))
        return Reason.AMBIGUOUS if numbering.ambiguous else NumberedCells(cells, numbering)

    def _is_complete(self, bgr: NDArray[np.uint8], found: NumberedCells, scale: int, stages: Stages) -> bool:
        """Whether a finer scale would number no more cells than have been numbered."""
        count = stages.record(
            "missed", count_missed_cells(bgr, found.cells, found.numbering, self._lattice, scale)
        )
        return int(count) <= MAX_MISSED_SHARE * len(self._lattice.ink)

    def _find(self, sights: Pyramid, scale: int, stages: Stages) -> Seeds | None:
        """Stages 1 to 3; None where an ink is absent."""
        colors = stages.record("color", to_colors(sights.at(scale).image))
        target = stages.record("target", find_target(colors))
        segmentation = stages.record("segment", segment(colors, target, self._nominal_hues_deg))
        if segmentation is None:
            return None
        # at a reduced scale, a crowd is what another scale may tell
        crowd = self._domain_limit if scale == 1 else NO_DOMAIN_LIMIT
        return stages.record("seeds", find_seeds(segmentation, crowd))  # type: ignore[no-any-return]

    def _measure_markers(self, sights: Pyramid, found: NumberedCells, stages: Stages) -> Markers:
        """The places of what has been numbered, and what follows from them."""
        cells, numbering = found
        places = stages.record("place", merge_corners(cells, numbering, self._lattice, sights.size))
        return self.finish(sights, places, numbering.mirrored, numbering.origin, stages)

    def finish(
        self,
        sights: Pyramid,
        places: InitialMarkers,
        mirrored: bool,
        origin: Origin,
        stages: Stages,
        before: Appearance | None = None,
    ) -> Markers:
        """Refinement, repair and virtual markers: the same for every way to a numbering."""
        refined = stages.record("refine", self._refiner(sights, places, before))
        repaired = stages.record("repair", repair_markers(refined, places, self._lattice, sights.size))
        virtual = stages.record("virtual", locate_virtual_markers(self._mesh, repaired, refined.points))
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

    def _no_markers(self, reason: Reason, stages: Stages) -> Markers:
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
