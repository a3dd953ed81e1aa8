"""The extractor: from an image to numbered markers, stage by stage. Every stage is timed.

Stages: image, seeds, grow, mesh, light, walk, number, triangles, place, refine, repair, virtual, quality. A warm
start of the tracker goes from image over prove to refine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cell_mesh import CellMesh, build_cell_mesh
from extractor.cells.cells import CODED_EFFORTS, EFFORTS, Cells, Effort, find_cells, has_color
from extractor.cells.region_growing import grow
from extractor.cells.triangle_fit import fit_edges, regions_as_cells
from extractor.complete.finished_markers import finish_markers
from extractor.complete.image_quality import (
    SampledCells,
    measure_quality_without_numbers,
    quality_of,
    sampled_cells,
)
from extractor.complete.reported_share import is_less_than_half_reported
from extractor.complete.row_breaks import NO_BREAK, beside_row_break, find_row_break
from extractor.complete.virtual_markers import locate_virtual_markers
from extractor.errors import LayoutError
from extractor.image.input import Channels, convert_to_bgr
from extractor.image.pyramid import Pyramid, PyramidLevel
from extractor.image.response import Response, light_of_values, response_tables
from extractor.layout.lattice_tables import Lattice, cells_between_whites, lattice_of
from extractor.layout.layout_file import LayoutLike, layouts_of
from extractor.layout.reference import Reference
from extractor.layout.topology import Topology, topology_of
from extractor.numbering.ink_fields import Palette
from extractor.numbering.lattice_walk import Walk, cell_light, walk_cells
from extractor.numbering.marker_places import InitialMarkers, merge_corners
from extractor.numbering.missing_cells import with_missing_cells
from extractor.numbering.registration import Numbering, Refusal, Registration
from extractor.numeric.median import select
from extractor.presets import PRESETS, Preset
from extractor.quality import Quality
from extractor.refine.estimate import Appearance
from extractor.refine.refiner import Refiner
from extractor.refine.relief import points_without_parallax
from extractor.result import VIRTUAL, Markers, Origin, Reason, VirtualMarkers

WORK_PIXELS = 64_000  # of the smallest reduced scale, at which recognition is tried first; chosen, for time
MIN_LEVEL_EDGE_PX = 7.0  # of the cells at a reduced scale; smaller ones are sought at a finer scale. Chosen
EQUILATERAL_AREA = math.sqrt(3.0) / 4.0  # over the square of the side
# The same of coded pads. Derived: regions over the least channel are 6 % smaller than regions in one channel.
MIN_CODED_LEVEL_EDGE_PX = 6.6
MAX_HOLE_SHARE = 0.02  # of a lattice that is not looked at more closely; chosen
MIN_GAIN = 1.1  # in linked cells, of a look that is followed by a closer one; chosen, for time
MIN_HOLES = 5  # the same as a number: the white cell may hide its three neighbours. Chosen
MAX_SMALL_HOLE_SHARE = (
    0.25  # of a lattice with too small cells, that is looked at at a finer scale; chosen, for time
)

Result = TypeVar("Result")
Side = Literal["designed", "front", "back", "either"]
SIDES: tuple[Side, ...] = ("designed", "front", "back", "either")
CHANNELS: tuple[Channels, ...] = ("bgr", "rgb")


class FoundCells(NamedTuple):
    """The cells of an image, their links, light, and places in the lattice."""

    cells: Cells
    mesh: CellMesh
    light: NDArray[np.float64]
    walk: Walk

    @property
    def linked(self) -> int:
        """The number of linked cells."""
        return int(np.count_nonzero(self.walk.part >= 0))

    @property
    def side_px(self) -> float:
        """The side of an equilateral triangle of the linked cells' median area; 0 without any."""
        areas = self.cells.area_px[self.walk.part >= 0]
        return math.sqrt(select(areas, len(areas) // 2) / EQUILATERAL_AREA) if len(areas) else 0.0

    def is_small(self, view: PyramidLevel, least_edge_px: float) -> bool:
        """Whether the linked cells are smaller, at this reduced scale, than the edge; also without any."""
        return view.scale > 1 and self.side_px < least_edge_px * view.scale


class NumberedCells(NamedTuple):
    """The cells of an image with their numbers."""

    found: FoundCells
    numbering: Numbering


class Unnumbered(NamedTuple):
    """The reason why no cell is numbered, and the cells that were found, if any."""

    refusal: Refusal
    found: FoundCells | None = None

    @property
    def weight(self) -> tuple[bool, bool, int]:
        """What orders reasons: that of a pattern first, then a second white cell, then that of most cells."""
        reason = self.refusal.reason
        return (
            reason != Reason.NO_PATTERN,
            reason == Reason.SEVERAL_PADS,
            self.found.linked if self.found else 0,
        )

    @property
    def edge_px(self) -> float:
        """The median side of the linked cells; NaN without a pattern."""
        if self.found is None or self.refusal.reason == Reason.NO_PATTERN:
            return math.nan
        return self.found.side_px / self.found.mesh.swelling


class NumberedMarkers(NamedTuple):
    """Numbered markers before refinement.

    Attributes:
        places: the markers at the places given by their cells.
        mirrored: the image shows the pattern's back.
        origin: the evidence that fixed the numbering.
        pad: number of the pad in its family.
    """

    places: InitialMarkers
    mirrored: bool
    origin: Origin
    pad: int = 0


class ReadImage(NamedTuple):
    """The markers of an image and, for the next image of a sequence, the appearance of this one.

    Attributes:
        markers: the markers.
        appearance: blur, noise and levels of the image; None where no pattern was found.
    """

    markers: Markers
    appearance: Appearance | None


class Stages:
    """A record of results and times by stage, for debugging and drawing; no stage reads it."""

    def __init__(self) -> None:
        self.results: dict[str, Any] = {}
        self.timings_ms: dict[str, float] = {}
        self._last = time.perf_counter()

    def record(self, name: str, result: Result) -> Result:
        """Add the time since the last stage to stage ``name``, keep the stage's result, and return this result."""
        now = time.perf_counter()
        self.timings_ms[name] = self.timings_ms.get(name, 0.0) + 1e3 * (now - self._last)
        self.results[name] = result
        self._last = now
        return result

    def keep(self, found: FoundCells) -> None:
        """Keep the results of the look that was numbered, not of the last one."""
        self.results |= {"seeds": found.cells, "mesh": found.mesh, "light": found.light, "walk": found.walk}


class _Pad:
    """What refinement, repair and quality need of one pad of a family; made when first needed."""

    def __init__(self, layout: Reference, lattice: Lattice, preset: Preset) -> None:
        self.layout, self.lattice = layout, lattice
        self._preset: Preset = preset

    @cached_property
    def topology(self) -> Topology:
        return topology_of(self.layout)

    @cached_property
    def refiner(self) -> Refiner:
        return Refiner(self.topology, self._preset, self.layout.virtual_per_edge)

    @cached_property
    def sampled_cells(self) -> SampledCells:
        return sampled_cells(self.layout)

    def prepare(self) -> None:
        """Make all of it, so that the first image does not wait."""
        _ = self.refiner, self.sampled_cells


class ImageReader:
    """Reads the images of one layout or family stage by stage, for extractors and trackers.

    Args:
        layout, preset, response, side, channels: see ``Extractor``.
    """

    def __init__(
        self,
        layout: LayoutLike | Sequence[LayoutLike],
        preset: Preset = "balanced",
        response: Response | None = None,
        side: Side = "designed",
        channels: Channels = "bgr",
    ) -> None:
        self.layouts = layouts_of(layout)
        layout = self.layouts[0]
        if layout.cell_corners.shape[1] != 3:
            raise LayoutError(
                f"pattern {layout.pattern!r} has no triangles; honeycomb, round or elliptical can be read"
            )
        self.layout = layout
        for name, value, allowed in (
            ("preset", preset, tuple(PRESETS)),
            ("channels", channels, CHANNELS),
        ):
            if value not in allowed:
                raise ValueError(f"{name} is {value!r}; give one of {', '.join(allowed)}")
        self.options = preset, response, side, channels
        self._channels = channels
        self._mirrored = is_mirrored(layout, side)
        by_depth: dict[np.dtype[Any], Response] = {np.dtype(np.uint8): "srgb", np.dtype(np.uint16): "linear"}
        self._tables = {
            depth: response_tables(light_of_values(usual if response is None else response))
            for depth, usual in by_depth.items()
        }
        self._pads = [_Pad(one, lattice_of(one), preset) for one in self.layouts]
        lattices = [pad.lattice for pad in self._pads]
        self._registration = Registration(lattices, Palette(dict(layout.palette)), self._mirrored)
        self._cells = len(lattices[0].ink)
        self._least_edge_px = MIN_LEVEL_EDGE_PX if layout.code is None else MIN_CODED_LEVEL_EDGE_PX
        self._hidden_cells = 0 if layout.code is None else cells_between_whites(lattices[0])
        self._efforts = EFFORTS if layout.code is None else CODED_EFFORTS
        self._pads[0].prepare()

    def read(self, image: NDArray[Any]) -> ReadImage:
        """The markers in one image, with the appearance that a tracker needs for the next image."""
        stages = Stages()
        return self.read_pyramid(self.pyramid(image, stages), stages)

    def read_pyramid(self, pyramid: Pyramid | None, stages: Stages) -> ReadImage:
        """``read`` of an image that is converted; None: without color."""
        if pyramid is None:
            return ReadImage(no_markers(self.layout, Reason.NO_COLOR, stages), None)
        found = self._number_cells(pyramid, stages)
        if isinstance(found, Unnumbered):
            quality = measure_quality_without_numbers(pyramid.level(1), found.edge_px)
            stages.record("quality", quality)
            return ReadImage(no_markers(self.layout, found.refusal.reason, stages, quality), None)
        (_, mesh, _, _), numbering = found
        lattice = self._pads[numbering.pad].lattice
        expected = with_missing_cells(mesh.corner_px, numbering, lattice)
        triangles = stages.record(
            "triangles", expected.measured(fit_edges(pyramid.level(1), expected.corner_px))
        )
        places = stages.record("place", merge_corners(triangles, lattice))
        numbered = NumberedMarkers(places, numbering.mirrored, numbering.origin, numbering.pad)
        return self.finish(pyramid, numbered, stages)

    def pyramid(self, image: NDArray[Any], stages: Stages | None = None) -> Pyramid | None:
        """An image for ``Extractor.extract`` at several scales, None without color; raises ``ImageError``."""
        bgr = convert_to_bgr(image, self._channels)
        if stages is not None:
            stages.record("image", bgr)
        return None if bgr is None else Pyramid(bgr, self._tables[image.dtype.newbyteorder("=")])

    def finish(
        self, pyramid: Pyramid, numbered: NumberedMarkers, stages: Stages, before: Appearance | None = None
    ) -> ReadImage:
        """Refinement, repair and virtual markers, the same for cold and warm starts.

        Args:
            pyramid: the image.
            numbered: the markers before refinement.
            stages: the record of the stages so far.
            before: appearance of the previous image of a sequence.
        """
        places, size, pad = numbered.places, pyramid.size, self._pads[numbered.pad]
        layout, topology = pad.layout, pad.topology
        refined = stages.record("refine", pad.refiner(pyramid, places, before))
        full, cells = pyramid.level(1), pad.sampled_cells
        found = finish_markers(full, refined, places, pad.lattice, topology, cells)
        is_whole = found.are_all_measured and not found.jumps.is_broken
        rows = NO_BREAK if is_whole else find_row_break(topology, found.jumps, found.repaired, size)
        repaired = stages.record("repair", beside_row_break(rows, found.repaired))
        parallax = refined.appearance.parallax

        def virtual() -> VirtualMarkers:
            points = refined.points[:, : layout.virtual_per_edge]
            if parallax is not None:
                points = points_without_parallax(parallax, topology.edges, repaired.xy_px, points)
            return locate_virtual_markers(topology, repaired, points, refined.scatter)

        few = not is_whole and is_less_than_half_reported(
            repaired.xy_px, layout.xy_mm, pad.lattice.present, size
        )
        quality = quality_of(found.cells, found.noise, found.edge_px, refined.blur_px, rows)
        stages.record("quality", quality)
        markers = Markers.with_later(
            {VIRTUAL: virtual},
            xy_px=repaired.xy_px,
            cov_px2=repaired.cov_px2,
            status=repaired.status,
            mirrored=numbered.mirrored,
            origin=numbered.origin,
            reason=Reason.FEW_MARKERS if few else None,
            timings_ms=stages.timings_ms,
            stages=stages.results,
            quality=quality,
            code=layout.code and layout.code.id,
        )
        return ReadImage(markers, refined.appearance)

    def _number_cells(self, pyramid: Pyramid, stages: Stages) -> NumberedCells | Unnumbered:
        """Stages 2 to 7 at the coarsest scale that numbers cells; else the reason where most cells were found."""
        scales = _recognition_scales(pyramid.size)
        failed = Unnumbered(Refusal(Reason.NO_PATTERN))
        for scale in scales:
            view = pyramid.level(scale)
            for found in self._looks(view, stages):
                numbering = stages.record("number", self._registration.number(view, *found))
                if not isinstance(numbering, Refusal):
                    stages.keep(found)
                    return NumberedCells(found, numbering)
                failed = max(failed, Unnumbered(numbering, found), key=lambda one: one.weight)
        is_gray = not has_color(pyramid.level(scales[0]).image)
        return Unnumbered(Refusal(Reason.NO_COLOR)) if is_gray else failed

    def _looks(self, view: PyramidLevel, stages: Stages) -> Iterator[FoundCells]:
        """The cells at one scale with more and more effort: first the looks in which all seem to be found, or that gain
        little, then the others, the last one first. Looks with too small cells are left out."""
        skipped: list[FoundCells] = []
        before: FoundCells | None = None
        for effort in self._efforts:
            found = self._find_cells(view, before.cells if before else None, effort, stages)
            gains = before is None or found.linked >= MIN_GAIN * before.linked
            before = found
            if found.is_small(view, self._least_edge_px):
                if self._is_whole(found, MAX_SMALL_HOLE_SHARE):
                    break
                continue
            if gains and effort is not self._efforts[-1] and not self._is_whole(found):
                skipped.append(found)
            else:
                yield found
        yield from reversed(skipped)

    def _find_cells(
        self, view: PyramidLevel, before: Cells | None, effort: Effort, stages: Stages
    ) -> FoundCells:
        cells = stages.record("seeds", find_cells(view, self._largest_edge_px(view), effort, before))
        if before is not None:
            cells = stages.record("grow", regions_as_cells(cells, grow(view, cells), view))
        mesh = stages.record("mesh", build_cell_mesh(cells))
        light = stages.record("light", cell_light(view, cells, mesh))
        walk = stages.record("walk", walk_cells(mesh, light))
        return FoundCells(cells, mesh, light, walk)

    def _largest_edge_px(self, view: PyramidLevel) -> float:
        """The edges of this pattern where it fills the image, px at full scale."""
        pixels = view.image.shape[0] * view.image.shape[1] * view.scale**2
        return math.sqrt(pixels / (2.0 * self._cells) * 4.0 / math.sqrt(3.0))

    def _is_whole(self, found: FoundCells, hole_share: float = MAX_HOLE_SHARE) -> bool:
        """Whether the cells of an image are all found but a share, as far as the cells themselves show it."""
        return found.linked >= self._registration.min_cells and found.walk.holes <= max(
            hole_share * found.linked + self._hidden_cells, MIN_HOLES
        )


class Extractor:
    """Finds and numbers the markers of one layout, or of the pads of a family, in images. Can be pickled and copied.

    >>> from extractor import Extractor
    >>> markers = Extractor("layout.json").extract(image)  # doctest: +SKIP
    >>> markers = Extractor(["left.json", "right.json"]).extract(image)  # doctest: +SKIP
    >>> markers.code  # doctest: +SKIP

    Args:
        layout: a triangular pattern: the path of its layout.json, a ``Reference``, the JSON object of a layout file, or
            a layout of cmpdesign. Or a list of these, a family: pads that differ in their codes alone. An image is of
            one of them, and ``Markers.code`` says of which one.
        preset: "balanced" or "accurate".
        response: relation of light and values: "srgb", "linear", an exponent (light is value ** exponent), or a table
            of the light of all 256 values. None: 8-bit images are sRGB, 16-bit images are linear.
        side: the side of the pattern that images show: "front", "back", or "designed": the side that the layout's
            ``mirrored`` states. An image of the other side gives no markers, and a reason. "either": both sides are
            read.
        channels: the order of an image's colors: "bgr", as in OpenCV, or "rgb".

    Raises:
        LayoutError: the layout is not a triangular pattern, its file cannot be read, or layouts are no family.
        TypeError: ``layout`` is of another type.
        ValueError: no such preset, response, side or order of channels.
    """

    def __init__(
        self,
        layout: LayoutLike | Sequence[LayoutLike],
        preset: Preset = "balanced",
        response: Response | None = None,
        side: Side = "designed",
        channels: Channels = "bgr",
    ) -> None:
        self._reader = ImageReader(layout, preset, response, side, channels)
        self.layouts, self.layout = self._reader.layouts, self._reader.layout

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is made from layout and options; buffers are not copied."""
        return type(self), (self.layouts, *self._reader.options)

    def layout_of(self, markers: Markers) -> Reference:
        """The layout of the pad that markers are of; of a family without a numbered pad, the first one."""
        return next((one for one in self.layouts if one.code and one.code.id == markers.code), self.layout)

    def extract(self, image: NDArray[Any]) -> Markers:
        """The markers in one image, found independently of other frames.

        Args:
            image: (H, W, 3) uint8, colors in the order of ``channels``; also uint16 of either byte order (scaled to 8
                bits), with alpha (dropped) and grayscale (without color no marker is found; the reason is
                ``NO_COLOR``). Need not be contiguous.

        Raises:
            ImageError: another dtype or shape, or a side below 16 px.
        """
        return self._reader.read(image).markers


def _recognition_scales(size: tuple[int, int]) -> list[int]:
    """The scales at which recognition is tried, from coarse to fine, for an image of this width and height, px."""
    scale = max(1, int(math.sqrt(size[0] * size[1] / WORK_PIXELS)))
    return [scale >> i for i in range(scale.bit_length())]


def is_mirrored(layout: Reference, side: Side) -> bool | None:
    """Whether images that show this side are mirrored; None where both sides are read; ``ValueError`` for no side."""
    if side not in SIDES:
        raise ValueError(f"side is {side!r}; give one of {', '.join(SIDES)}")
    return {"designed": layout.mirrored, "front": False, "back": True, "either": None}[side]


def no_markers(layout: Reference, reason: Reason, stages: Stages, quality: Quality | None = None) -> Markers:
    """The result for an image in which no marker was found."""
    markers, edges, count = len(layout.layer), len(layout.edges), layout.virtual_per_edge
    return Markers(
        xy_px=np.full((markers, 2), np.nan),
        cov_px2=np.full((markers, 2, 2), np.nan),
        status=np.zeros(markers, np.uint8),
        virtual_xy_px=np.full((edges, count, 2), np.nan),
        virtual_cov_px2=np.full((edges, count, 2, 2), np.nan),
        virtual_status=np.zeros((edges, count), np.uint8),
        mirrored=None,
        reason=reason,
        timings_ms=stages.timings_ms,
        stages=stages.results,
        quality=quality,
    )
