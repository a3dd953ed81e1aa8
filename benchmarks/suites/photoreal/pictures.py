"""A folder of path-traced pictures: the index, one picture with its truth, and the layout of its pad."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import load_design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import AsMade, Layout
from cmpdesign.layout.side import seen_side

PICTURES_FOLDER = Path(__file__).parents[2] / "photoreal" / "pictures"
NO_PATTERN = "N"  # the family of pictures without a pattern


@dataclass(frozen=True)
class TracedPicture:
    """One entry of a folder's index. ``family`` is a letter; ``effects`` are the effects in the picture."""

    folder: Path
    name: str
    family: str
    effects: tuple[str, ...]

    @cached_property
    def image(self) -> NDArray[np.uint8]:
        """(H, W, 3) uint8 BGR."""
        image = cv2.imread(str(self.folder / f"{self.name}.webp"))
        if image is None:
            raise ValueError(f"{self.folder / self.name}.webp is no picture; give a folder with all pictures")
        return np.asarray(image, dtype=np.uint8)

    @cached_property
    def truth(self) -> TracedTruth:
        """The truth; for a picture without a pattern, that of the pad whose cells were changed."""
        with np.load(self.folder / f"{self.name}.npz", allow_pickle=False) as file:
            columns = {
                name: file[name] for name in ("xy_px", "xy_lines_px", "xy_deep_px", "visible", "edge_px")
            }
            scene = json.loads(str(file["scene"]))
        return TracedTruth(**columns, scene=scene)


@dataclass(frozen=True, eq=False)
class TracedTruth:
    """The truth of one picture; markers in the order of their ids.

    Attributes:
        xy_px: (M, 2) float64, in the plane of the black.
        xy_lines_px: (M, 2) float64, where the sides of the cells as made cross; ``xy_px`` for cells as designed.
        xy_deep_px: (M, 2) float64, in the plane at half the height of the cells; ``xy_px`` for flat pads.
        visible: (M,) bool.
        edge_px: (M,) float64, the edge's length at each marker.
        scene: parameters of the scene.
    """

    xy_px: NDArray[np.float64]
    xy_lines_px: NDArray[np.float64]
    xy_deep_px: NDArray[np.float64]
    visible: NDArray[np.bool_]
    edge_px: NDArray[np.float64]
    scene: dict[str, Any]

    @property
    def relief_mm(self) -> float:
        """Height of the cells over the black; 0 for a flat pad."""
        return float(self.scene.get("relief") or 0.0)

    @property
    def is_as_designed(self) -> bool:
        """No relief, and no misregistered or scattered cells."""
        return self.relief_mm == 0 and np.array_equal(self.xy_lines_px, self.xy_px)

    def layout(self, with_relief: bool = False) -> Layout:
        """The designed layout of the pad; ``with_relief``: as made, with the height of the cells."""
        scene = self.scene
        values = {
            "layers": scene["layers"],
            "pitch_mm": scene["pitch_mm"],
            "mirrored": scene["side"] == "back",
        }
        if scene["kind"] == "elliptical":
            values["aspect"] = scene["aspect"]
        layout = build_layout(load_design(scene["kind"], {k: str(v).lower() for k, v in values.items()}))
        if not with_relief:
            return layout
        side = seen_side(layout.mirrored)
        return replace(layout, as_made=AsMade(layout.digest, "measured", side, cell_height_mm=self.relief_mm))


def load_pictures(folder: Path) -> list[TracedPicture]:
    """The pictures of a folder in the order of their names.

    Raises:
        ValueError: the folder has no index.
    """
    path = folder / "index.json"
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        found = [TracedPicture(folder, e["name"], e["family"], tuple(e["effects"])) for e in entries]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is no index of pictures ({error}); give a folder with index.json") from None
    return sorted(found, key=lambda picture: picture.name)


def first_of_families(pictures: Sequence[TracedPicture]) -> list[TracedPicture]:
    """The first picture of every family."""
    first = {picture.family: picture for picture in reversed(pictures)}
    return sorted(first.values(), key=lambda picture: picture.name)
