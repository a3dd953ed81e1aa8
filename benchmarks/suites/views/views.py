"""Random views whose white cell is covered or out of view: crops, and crops with covered spots and scratches.

What is seen is known by the truth: colored cells that lie wholly in the picture, away from every cover. The covers have
the colors of the ground, of the inks or of skin, as dirt, wear and fingers have.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.camera.parts import PATTERNS, SIZE_PX, Chain, Lens, Pose, Sensor
from benchmarks.suites.camera.reading import WRONG_ID, cached_extractor, marker_outcomes
from benchmarks.suites.camera.shoot import CameraPicture, shoot
from benchmarks.suites.views.motions import fitting_motions
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, WHITE
from extractor.layout.lattice import axial_coordinates

CROPS, DAMAGED = "crops", "damaged crops"
KINDS = (CROPS, DAMAGED)
LAYERS = (5, 11)
PITCH_PX = (24.0, 44.0)
WHITE_COVER_EDGES = 1.0  # radius of the cover of the white cell
SPOTS, SPOT_EDGES = (1, 8), (0.4, 2.5)  # number, radius
SCRATCHES, SCRATCH_EDGES = (0, 3), (0.1, 0.5)  # number, width
COVER_BGR = ((20, 20, 20), (128, 128, 128), (150, 180, 220), (45, 50, 200), (60, 150, 40), (190, 60, 45))
COVER_NOISE = 2.0  # of 255
MIN_SHARE = 0.25  # of a cell that is partly seen
CLEAR_PX = 2  # distance of a seen cell from every cover and from the picture's rim


@dataclass(frozen=True)
class DrawnView:
    """One view of a run. Views that differ in their codes alone differ in their white cells alone."""

    kind: str
    seed: int
    number: int
    code: int = 0
    pitch_px: tuple[float, float] = PITCH_PX


class SeenCells(NamedTuple):
    """What is seen of a pattern, by the truth.

    Attributes:
        cells: wholly seen colored cells.
        black_cells: wholly seen black and white ones.
        motions: motions that put the colored ones into the pattern, the true one included; 0 without cells.
        motions_of_parts: motions that put partly seen cells into the pattern, too.
    """

    cells: int
    black_cells: int
    motions: int
    motions_of_parts: int


@dataclass(frozen=True)
class ViewResult:
    """The result of one view.

    Attributes:
        view: the view.
        seen: what is seen.
        reported: markers with a position.
        wrong_ids: markers reported at another marker's place.
        reason: the reader's reason; empty without one.
    """

    view: DrawnView
    seen: SeenCells
    reported: int
    wrong_ids: int
    reason: str

    @property
    def is_read(self) -> bool:
        return self.reported > 0


@dataclass(frozen=True, eq=False)
class ShotView:
    """The picture of a view with its covers; ``visible`` are the markers away from them."""

    pose: Pose
    picture: CameraPicture
    seen: SeenCells


def shoot_view(view: DrawnView) -> ShotView:
    """Shoot and cover a view."""
    rng = np.random.default_rng([view.seed, view.number, KINDS.index(view.kind)])
    pose = _sample_pose(view, rng)
    lens = Lens(blur_px=float(rng.uniform(0.6, 1.1)))
    picture = shoot(Chain(pose=pose, lens=lens, sensor=Sensor(), seed=int(rng.integers(2**31))))
    covers = _covers(picture, pose, view.kind, rng)
    picture = replace(
        picture,
        image=_covered(picture.image, covers, rng),
        visible=picture.visible & ~_are_covered(picture.marker_xy_px, covers),
    )
    cells = colored_cells(picture.layout)
    seen = up_cells(picture.layout, seen_cells(picture, covers, cells))
    black = seen_cells(picture, covers, np.setdiff1d(np.arange(len(picture.layout.cell_corners)), cells))
    pattern = up_cells(picture.layout, cells)
    parts = up_cells(picture.layout, partly_seen_cells(picture, covers))
    motions, of_parts = (fitting_motions(pattern, some) if len(some) else 0 for some in (seen, parts))
    return ShotView(pose, picture, SeenCells(len(seen), len(black), motions, of_parts))


def read_view(view: DrawnView) -> ViewResult:
    """Shoot, cover, and read a view; one thread."""
    cv2.setNumThreads(1)
    shot = shoot_view(view)
    pose = shot.pose
    markers = cached_extractor(pose.pattern, pose.layers, "balanced", pose.code).extract(shot.picture.image)
    return ViewResult(
        view=view,
        seen=shot.seen,
        reported=int(markers.status.astype(bool).sum()),
        wrong_ids=int((marker_outcomes(shot.picture, markers) == WRONG_ID).sum()),
        reason=str(markers.reason or ""),
    )


def _are_covered(xy_px: NDArray[np.float64], covers: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(M,) whether places lie on a cover; places outside the picture do not."""
    place = np.rint(np.nan_to_num(xy_px, nan=-1.0)).astype(int)
    inside = ((place >= 0) & (place < covers.shape[::-1])).all(axis=1)
    covered = np.zeros(len(place), np.bool_)
    covered[inside] = covers[place[inside, 1], place[inside, 0]] > 0
    return covered


def colored_cells(layout: Layout) -> NDArray[np.int64]:
    """(N,) the red, green and blue cells."""
    return np.flatnonzero((layout.cell_color != BLACK) & (layout.cell_color != WHITE))


def up_cells(layout: Layout, cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N, 2) the axial coordinates of up-cells: of the marker (q, r) of the corners (q, r), (q + 1, r), (q, r + 1)."""
    axial = axial_coordinates(layout.marker_layer, layout.marker_index)
    return np.asarray(axial[layout.cell_corners[cells]].min(axis=1), dtype=np.int64)


def seen_cells(
    picture: CameraPicture, covers: NDArray[np.uint8], cells: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(K,) those of some cells (N,) that lie wholly in the picture and clear of all covers (H, W), 0: none."""
    near = cv2.dilate(covers, np.ones((2 * CLEAR_PX + 1,) * 2, np.uint8))
    corners = picture.marker_xy_px[picture.layout.cell_corners[cells]]
    size = np.array(SIZE_PX) - 1
    inside = ((corners >= CLEAR_PX) & (corners <= size - CLEAR_PX)).all(axis=(1, 2))
    clear = [not _touches(near, triangle) for triangle in corners[inside]]
    return np.asarray(cells[inside][np.array(clear, dtype=np.bool_)])


def partly_seen_cells(picture: CameraPicture, covers: NDArray[np.uint8]) -> NDArray[np.int64]:
    """(K,) the red, green and blue cells of which at least ``MIN_SHARE`` is in the picture and not covered."""
    cells = colored_cells(picture.layout)
    corners = np.rint(picture.marker_xy_px[picture.layout.cell_corners[cells]]).astype(int)
    return np.asarray(cells[[_seen_share(covers, triangle) >= MIN_SHARE for triangle in corners]])


def _seen_share(covers: NDArray[np.uint8], triangle: NDArray[np.int64]) -> float:
    low, size = triangle.min(axis=0), np.ptp(triangle, axis=0) + 1
    inside = np.zeros(size[::-1], np.uint8)
    cv2.fillConvexPoly(inside, (triangle - low).astype(np.int32), 1)
    place = np.argwhere(inside)[:, ::-1] + low
    place = place[((place >= 0) & (place < covers.shape[::-1])).all(axis=1)]
    return float(np.count_nonzero(covers[place[:, 1], place[:, 0]] == 0) / np.count_nonzero(inside))


def _touches(covers: NDArray[np.uint8], triangle: NDArray[np.float64]) -> bool:
    mask = np.zeros_like(covers)
    cv2.fillConvexPoly(mask, np.rint(triangle).astype(np.int32), 1)
    left, top = triangle.min(axis=0).astype(int)
    right, bottom = np.ceil(triangle.max(axis=0)).astype(int) + 1
    return bool((mask[top:bottom, left:right] & (covers[top:bottom, left:right] > 0)).any())


def _sample_pose(view: DrawnView, rng: np.random.Generator) -> Pose:
    """A pattern of any size, its middle up to 0.9 of its radius from the picture's."""
    layers, pitch_px = int(rng.integers(*LAYERS, endpoint=True)), float(rng.uniform(*view.pitch_px))
    distance, angle = rng.uniform(0, 0.9) * layers * pitch_px, rng.uniform(0, 2 * np.pi)
    middle = (np.array(SIZE_PX) - 1) / 2 + distance * np.array([np.cos(angle), np.sin(angle)])
    return Pose(
        pattern=str(rng.choice(PATTERNS)),
        layers=layers,
        code=view.code,
        pitch_px=pitch_px,
        roll_deg=float(rng.uniform(0, 360)),
        tilt_deg=float(rng.uniform(0, 30)),
        tilt_axis_deg=float(rng.uniform(0, 180)),
        centre_px=(float(middle[0]), float(middle[1])),
    )


def _covers(picture: CameraPicture, pose: Pose, kind: str, rng: np.random.Generator) -> NDArray[np.uint8]:
    """(H, W) uint8: 0, or 1 + the number of the cover's color."""
    covers = np.zeros(picture.image.shape[:2], dtype=np.uint8)

    def color() -> int:
        return 1 + int(rng.integers(len(COVER_BGR)))

    if kind == DAMAGED:
        for _ in range(int(rng.integers(*SPOTS, endpoint=True))):
            place, radius = rng.uniform((0, 0), SIZE_PX), rng.uniform(*SPOT_EDGES) * pose.pitch_px
            axes = (round(radius), round(radius * rng.uniform(0.4, 1.0)))
            cv2.ellipse(
                covers, np.rint(place).astype(int).tolist(), axes, rng.uniform(0, 180), 0, 360, color(), -1
            )
        for _ in range(int(rng.integers(*SCRATCHES, endpoint=True))):
            ends = np.rint(rng.uniform((0, 0), SIZE_PX, (2, 2))).astype(int).tolist()
            width = max(round(rng.uniform(*SCRATCH_EDGES) * pose.pitch_px), 1)
            cv2.line(covers, ends[0], ends[1], color(), width)
    layout = picture.layout
    middle = picture.marker_xy_px[layout.cell_corners[layout.reference_cell]].mean(axis=0)
    cv2.circle(
        covers, np.rint(middle).astype(int).tolist(), round(WHITE_COVER_EDGES * pose.pitch_px), color(), -1
    )
    return covers


def _covered(
    image: NDArray[np.uint8], covers: NDArray[np.uint8], rng: np.random.Generator
) -> NDArray[np.uint8]:
    """The picture with its covers, slightly blurred and with noise."""
    colors = np.array([(0, 0, 0), *COVER_BGR], dtype=np.float32)[covers]
    colors += rng.normal(0, COVER_NOISE, colors.shape).astype(np.float32)
    share = cv2.GaussianBlur((covers > 0).astype(np.float32), (0, 0), 0.8)[..., None]
    return np.clip(np.rint(image + share * (colors - image)), 0, 255).astype(np.uint8)
