"""One frame of a plan: its parameters are drawn, its scene is solved and rendered, its picture encoded and read.

A frame is a function of the plan's digest, the shard's number and its place in the shard: the random numbers come from
the SHA-256 of these three.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact import Contact
from cmpdesign.data.frames.distributions import draw
from cmpdesign.data.frames.plan import PlanError, design_choice
from cmpdesign.data.named_files import check_inputs, named_layouts
from cmpdesign.files.images import decode_bytes, to_jpeg, to_png
from cmpdesign.layout.layout import Layout
from cmpdesign.reading.read_layout import layout_from_reference
from cmpdesign.scene import Pinhole, Rendered, Scene, SceneError, Sensor, render
from cmpdesign.scene.drawing.view import scene_views
from cmpdesign.scene.files.scene_file import SceneFile, SolvedScene, scene_from_document
from extractor import Extractor, Markers, Reference
from extractor.pipeline import Side

MAX_ATTEMPTS = 20  # draws of one frame
MAX_READERS = 64
SEEDS = 1 << 32
Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class FrameRecord:
    """A frame: V views of M markers. Lengths of arrays are those of the design's layout.

    Attributes:
        number: of the frame in the data set.
        design: name of the design.
        redrawn: number of earlier draws that could not be rendered.
        document: the drawn scene, as in a scene file.
        image: the bytes of the encoded picture.
        size_px: (width, height).
        contact: forces and strain; None without an object.
        warnings: reasons to doubt the scene.
        truth: name -> array: rest_xy_px, true_xy_px (V, M, 2) px, visible (V, M), true_xyz_mm (M, 3).
        markers: one for each view; empty where markers are not read.
    """

    number: int
    design: str
    redrawn: int
    document: Mapping[str, Any]
    image: bytes
    size_px: tuple[int, int]
    contact: Contact | None
    warnings: tuple[str, ...]
    truth: Mapping[str, Array]
    markers: tuple[Markers, ...]


@dataclass(frozen=True, eq=False)
class ReadableDesign:
    """A design with its layout."""

    name: str
    reference: Reference
    layout: Layout


class FrameMaker:
    """Makes the frames of one plan; layouts and readers are kept from frame to frame.

    Args:
        folder: the data set, for layouts and the files that scenes name.
        plan: the object of plan.json.
    """

    def __init__(self, folder: Path, plan: Mapping[str, Any]) -> None:
        self._folder, self._plan = folder, plan
        check_inputs(folder, plan)
        self._designs = [
            ReadableDesign(name, reference, layout_from_reference(reference))
            for name, reference in named_layouts(folder, plan).items()
        ]
        self._readers: dict[str, Extractor] = {}
        self._choice = design_choice(plan["designs"], plan["weights"])

    def _reader(self, design: ReadableDesign, mirrored: bool, response: Any) -> Extractor:
        """The reader for a side and the sensor's response; the last readers are kept."""
        key = f"{design.name} {mirrored} {response}"
        if key not in self._readers:
            if len(self._readers) >= MAX_READERS:
                self._readers.clear()
            side: Side = "back" if mirrored else "front"
            preset = self._plan["markers"]["preset"]
            self._readers[key] = Extractor(design.reference, preset, response, side)
        return self._readers[key]

    def frame(self, shard: int, place: int) -> FrameRecord:
        """The frame at a place of a shard.

        Raises:
            PlanError: no draw of ``MAX_ATTEMPTS`` can be rendered.
            SceneError: a draw has values that no scene can have.
        """
        number = shard * self._plan["frames_a_shard"] + place
        for attempt in range(MAX_ATTEMPTS):
            rng = frame_rng(self._plan["digest"], shard, place, attempt)
            design = self._designs[draw(self._choice, rng)]
            document = draw(self._plan["scene"], rng) | {"seed": int(SEEDS * rng.random())}
            file = scene_from_document(document, self._folder / f"frame {number}", design.layout)
            try:
                return self._record(number, attempt, design, file)
            except SceneError as error:
                problem = str(error)
        raise PlanError(
            f"frame {number}: none of {MAX_ATTEMPTS} draws can be rendered; the last draw: {problem}; "
            "narrow the plan's ranges"
        )

    def _record(self, number: int, attempt: int, design: ReadableDesign, file: SceneFile) -> FrameRecord:
        solved = next(file.solved_scenes())
        most, contact = self._plan["largest_strain"], solved.contact
        if most is not None and contact is not None and contact.largest_strain > most:
            raise SceneError(f"the largest strain is {contact.largest_strain:.2g}, the plan's limit {most:g}")
        rendered = render(solved.scene, size=file.size_px)
        image = self._encode(rendered.image)
        return FrameRecord(
            number=number,
            design=design.name,
            redrawn=attempt,
            document=file.document,
            image=image,
            size_px=file.size_px,
            contact=solved.contact,
            warnings=rendered.warnings,
            truth=_truth(solved, rendered, file.size_px),
            markers=self._read(design, image, solved.scene, rendered),
        )

    def _encode(self, image: Array) -> bytes:
        if self._plan["image"]["kind"] == "png":
            return to_png(image)
        return to_jpeg(image, self._plan["image"]["quality"])

    def _read(
        self, design: ReadableDesign, image: bytes, scene: Scene, rendered: Rendered
    ) -> tuple[Markers, ...]:
        """The markers of every view, from the encoded picture."""
        if not self._plan["markers"]["read"]:
            return ()
        pixels = decode_bytes(image, "frame")
        cameras = scene.camera if isinstance(scene.camera, tuple) else (scene.camera,)
        sides = np.atleast_1d(rendered.truth.mirrored)
        response = (scene.sensor or Sensor()).response
        found = []
        for camera, mirrored in zip(cameras, sides, strict=True):
            area = camera.area_px if isinstance(camera, Pinhole) else None
            x, y, width, height = area or (0, 0, *pixels.shape[1::-1])
            view = np.ascontiguousarray(pixels[y : y + height, x : x + width])
            markers = self._reader(design, bool(mirrored), response).extract(view)
            found.append(replace(markers, xy_px=markers.xy_px + [x, y]) if x or y else markers)
        return tuple(found)


def frame_rng(digest: str, shard: int, place: int, attempt: int) -> np.random.Generator:
    """The random stream of one draw of a frame."""
    name = f"{digest} {shard} {place} {attempt}"
    entropy = int.from_bytes(hashlib.sha256(name.encode()).digest(), "big")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy)))


def _truth(solved: SolvedScene, rendered: Rendered, size_px: tuple[int, int]) -> dict[str, Array]:
    truth, scene = rendered.truth, solved.scene
    several = isinstance(scene.camera, tuple)
    at_rest = scene_views(replace(scene, surface=None), size_px)
    return {
        "rest_xy_px": np.stack([view.image_from_layout(scene.layout.marker_xy_mm) for view in at_rest]),
        "true_xy_px": truth.marker_xy_px if several else truth.marker_xy_px[None],
        "visible": truth.visible if several else truth.visible[None],
        "true_xyz_mm": truth.marker_xyz_mm,
    }


def document_text(document: Mapping[str, Any]) -> str:
    """A drawn scene on one line."""
    return json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
