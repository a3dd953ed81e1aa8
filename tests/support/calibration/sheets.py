"""Points of sheets in the pictures of known cameras, with noise, for tests of calibration."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from cmpdesign.calibration.sightings import Sheet, Sighting
from extractor import View

SIZE_PX = (1280, 960)
CHESSBOARDS = Path(__file__).parent / "wide.json"


def lattice(layers: int = 6, pitch_mm: float = 2.0) -> Sheet:
    """A hexagon of points, 4 layers * pitch wide."""
    steps = range(-layers, layers + 1)
    places = [(q + r / 2, r * np.sqrt(3) / 2) for q in steps for r in steps if abs(q + r) <= layers]
    return Sheet(pitch_mm * np.array(places))


def camera(focal_px: float = 900.0, **changes: object) -> View:
    """A camera with mild distortion."""
    lens = (-0.15, 0.05, 0.0004, -0.0003, 0.0)
    values: dict[str, object] = {"distortion": lens, **changes}
    return View("true", (focal_px, focal_px * 1.0003), (645.2, 474.1), **values)  # type: ignore[arg-type]


def see(
    view: View,
    sheet: Sheet,
    count: int,
    rng: np.random.Generator,
    *,
    sigma_px: float = 0.01,
    tilt_deg: tuple[float, float] = (10, 35),
    height_mm: float = 0.0,
) -> list[Sighting]:
    """The points in ``count`` pictures; the sheet is a cylinder of this height, and deviations are stated."""
    half = sheet.size_mm
    flat = sheet.flat_mm
    if height_mm:
        radius = (half**2 + height_mm**2) / (2 * height_mm)
        x = flat[:, 0]
        flat = np.column_stack([radius * np.sin(x / radius), flat[:, 1], radius * (1 - np.cos(x / radius))])
    out: list[Sighting] = []
    while len(out) < count:
        axis, tilt = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(*tilt_deg))
        turn = cv2.Rodrigues(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))[0]
        spin = cv2.Rodrigues(np.array([0, 0, rng.uniform(0, 2 * np.pi)]))[0]
        direction = view.normalised(rng.uniform(0.35, 0.65, (1, 2)) * SIZE_PX)[0]
        depth_mm = 2.4 * half * view.focal_px[0] / SIZE_PX[1]
        shift = np.array([*direction, 1.0]) * depth_mm
        placed = view.at(turn @ spin @ np.diag([1.0, -1.0, -1.0]), shift)
        xy_px = placed.project(flat)
        if not ((xy_px > 2) & (xy_px < np.array(SIZE_PX) - 3)).all():
            continue
        sigma = sigma_px * np.exp(rng.normal(0, 0.3, len(flat)))
        noisy = xy_px + rng.normal(size=xy_px.shape) * sigma[:, None]
        cov = sigma[:, None, None] ** 2 * np.eye(2)
        out.append(Sighting(f"p{len(out)}.png", np.arange(len(flat)), noisy, cov))
    return out


def zoomed(sighting: Sighting, share: float) -> Sighting:
    """The points of the same picture with a longer focal length."""
    middle = np.array(SIZE_PX) / 2
    return sighting._replace(xy_px=middle + (1 + share) * (sighting.xy_px - middle))


def without_deviations(sightings: list[Sighting]) -> list[Sighting]:
    """The same points, of unknown deviations."""
    return [one._replace(cov_px2=None) for one in sightings]


def chessboards() -> tuple[Sheet, list[Sighting]]:
    """Corners of a real camera's pictures, see the folder's README."""
    document = json.loads(CHESSBOARDS.read_text(encoding="utf-8"))
    board = document["board"]
    places = [(column, row) for row in range(board["rows"]) for column in range(board["columns"])]
    ids = np.arange(len(places))
    found = [Sighting(view["picture"], ids, np.array(view["xy_px"])) for view in document["views"]]
    return Sheet(np.array(places, float)), found


def fisheye(field_deg: float = 110.0) -> View:
    """A wide camera with a lens near the equidistant one."""
    focal_px = SIZE_PX[0] / 2 / np.radians(field_deg / 2)
    return replace(camera(focal_px), lens="fisheye", distortion=(0.02, -0.008, 0.002, -0.0005))
