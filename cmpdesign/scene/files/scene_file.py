"""Scene files: a TOML that composes a scene or a sequence of scenes; absent parts are not computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import InputError
from cmpdesign.inputs.documents import read_toml
from cmpdesign.inputs.names import nearest_name
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import COLORS
from cmpdesign.scene.camera.pinhole import Pinhole
from cmpdesign.scene.camera.plain import Camera
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.files.key_frames import KeyFrames, document_at_time, flatten_table
from cmpdesign.scene.files.tables import (
    BackgroundTable,
    SceneTables,
    SurfaceTable,
    read_background,
    read_tables,
)
from cmpdesign.scene.parts.background import Background, Picture, Plain
from cmpdesign.scene.parts.surface import composed
from cmpdesign.scene.scene import Scene

if TYPE_CHECKING:
    from cmpdesign.contact import Contact

PointMap = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class SolvedScene:
    """A scene and its contact; None without [contact]."""

    scene: Scene
    contact: Contact | None


@dataclass(frozen=True, eq=False)
class SceneFile:
    """A scene file with a layout.

    Attributes:
        path: the file's path; relative paths in the file start at its folder.
        layout: the pattern.
        document: the TOML document without [sequence].
        size_px: the image's (width, height).
        frames: number of frames; 1 without [sequence].
        fps: frames per second; None without [sequence].
        values: key frames by dotted path.
    """

    path: Path
    layout: Layout
    document: Mapping[str, Any]
    size_px: tuple[int, int]
    frames: int = 1
    fps: float | None = None
    values: Mapping[str, KeyFrames] = field(default_factory=dict)

    def time_s(self, frame: int) -> float:
        """The time of a frame in s."""
        return frame / self.fps if self.fps else 0.0

    @property
    def bits(self) -> int:
        """Bits per channel of the images."""
        sensor = self._tables(0).sensor
        return sensor.bits if sensor else 8

    def scene(self) -> Scene:
        """The scene; of a sequence the first frame's scene.

        Raises:
            SceneError: the message names file, table and key.
        """
        return next(self.scenes())

    def scenes(self) -> Iterator[Scene]:
        """The scene of every frame, in order; each is made when it is requested.

        Raises:
            SceneError: the message names file, table and key.
        """
        return (solved.scene for solved in self.solved_scenes())

    def solved_scenes(self) -> Iterator[SolvedScene]:
        """The scenes of ``scenes``, each with its contact.

        Raises:
            SceneError: see ``scenes``.
        """
        with _errors_with_path(self.path):
            contacts = self._contacts()
            for frame in range(self.frames):
                tables = self._tables(frame)
                contact = next(contacts, None)
                parts = list(_make_deformations(tables.surface, self.document))
                if contact is not None:
                    parts.append(contact.marker_layer())
                scene = Scene(
                    **_make_parts(tables, self),
                    surface=composed(*parts) if parts else None,
                    seed=tables.seed,
                    frame=frame,
                    warnings=() if contact is None else contact.warnings,
                )
                yield SolvedScene(scene, contact)

    def _contacts(self) -> Iterator[Contact]:
        """The contact of every frame; empty, without importing the solver, if there is no [contact]."""
        if "contact" not in self.document:
            return
        from cmpdesign.scene.files.contacts import solve_contacts

        tables = [self._tables(frame).contact or {} for frame in range(self.frames)]
        yield from solve_contacts(tables, list(self.values), self.path.parent)

    def _tables(self, frame: int) -> SceneTables:
        return read_tables(document_at_time(self.document, self.values, self.time_s(frame)))


@contextmanager
def _errors_with_path(path: Path) -> Iterator[None]:
    """Prefix the messages of scene errors with the file's path."""
    try:
        yield
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def load_scene(
    path: str | Path, layout: Layout, *, size_px: tuple[int, int] | None = None, seed: int | None = None
) -> SceneFile:
    """Read and check a scene file, at every key frame of a sequence, without drawing or solving.

    Args:
        path: the TOML file.
        layout: the pattern.
        size_px, seed: values that replace those of the file.

    Raises:
        SceneError: the file cannot be read, is not TOML, or has a name or value that is not allowed.
    """
    path = Path(path)
    try:
        document = read_toml(path)
    except InputError as error:
        raise SceneError(str(error)) from None
    replacements = {"size_px": size_px and list(size_px), "seed": seed}
    document |= {name: value for name, value in replacements.items() if value is not None}
    return scene_from_document(document, path, layout)


def scene_from_document(document: Mapping[str, Any], path: Path, layout: Layout) -> SceneFile:
    """Check the document of a scene file, as ``load_scene`` does.

    Args:
        document: the TOML document.
        path: path of the document, for messages; relative paths in the document start at its folder.
        layout: the pattern.

    Raises:
        SceneError: a name or value that is not allowed.
    """
    document = dict(document)
    with _errors_with_path(path):
        sequence = document.pop("sequence", None)
        if isinstance(sequence, dict) and isinstance(sequence.get("values"), dict):
            sequence = {**sequence, "values": flatten_table(sequence["values"])}
        tables = read_tables(document if sequence is None else {**document, "sequence": sequence})
        scene_file = SceneFile(path, layout, document, tables.size_px)
        if tables.sequence is not None:
            frames, fps, values = tables.sequence.frames, tables.sequence.fps, tables.sequence.values
            scene_file = replace(scene_file, frames=frames, fps=fps, values=MappingProxyType(values))
        for time_s in sorted({0.0} | {key[0] for keys in scene_file.values.values() for key in keys}):
            _check_tables(read_tables(document_at_time(document, scene_file.values, time_s)), scene_file)
    return scene_file


def _check_tables(tables: SceneTables, file: SceneFile) -> None:
    """Check all values without solving and without drawing."""
    _make_parts(tables, file)
    if tables.contact is not None:
        from cmpdesign.scene.files.contacts import check_contact

        check_contact(tables.contact, file.path.parent)


def _make_parts(tables: SceneTables, file: SceneFile) -> dict[str, Any]:
    """The arguments of ``Scene`` except for the surface, which may need a solution."""
    return {
        "layout": file.layout,
        "camera": _make_camera(tables),
        "medium": tables.medium,
        "light": tables.light,
        "background": _make_background(tables, file.path),
        "optics": tables.optics,
        "sensor": tables.sensor,
        "damage": tables.damage,
        "inks": {name: _parse_rgb(value, name) for name, value in tables.inks.items()},
    }


def _make_camera(tables: SceneTables) -> Camera | Pinhole | tuple[Pinhole, ...]:
    """The camera: one [[view]] is a pinhole, several are a tuple, which gives the truth a leading axis."""
    if tables.view is None:
        return tables.camera or Camera()
    cameras = []
    for number, table in enumerate(tables.view):
        try:
            cameras.append(table.pinhole(tables.size_px))
        except SceneError as error:
            raise SceneError(f"[[view]] {number}: {error}") from None
    return cameras[0] if len(cameras) == 1 else tuple(cameras)


def _make_deformations(table: SurfaceTable | None, document: Mapping[str, Any]) -> Iterator[PointMap]:
    """The deformations of [surface] in the file's order."""
    if table is not None:
        for name in document["surface"]:
            yield getattr(table, name)


def _make_background(tables: SceneTables, path: Path) -> Background:
    if tables.background is None:
        return Plain()
    background = read_background(tables.background)
    if not isinstance(background, BackgroundTable):
        return background  # type: ignore[no-any-return]
    from cmpdesign.files.images import ImageFileError, read_image

    try:
        picture = read_image(path.parent / background.path)
    except ImageFileError as error:
        raise SceneError(f"[background] path: {error}") from None
    return Picture(picture.astype(np.uint8) if picture.dtype == np.uint8 else (picture >> 8).astype(np.uint8))


def _parse_rgb(value: tuple[float, float, float] | str, name: str) -> tuple[float, float, float]:
    if name not in COLORS:
        raise SceneError(
            f"[inks] {name} is unknown{nearest_name(name, COLORS)}; the inks are {', '.join(COLORS)}"
        )
    if not isinstance(value, str):
        return value
    digits = value.removeprefix("#")
    if len(digits) != 6 or any(digit not in "0123456789abcdefABCDEF" for digit in digits):
        raise SceneError(f'[inks] {name} is "{value}"; write "#c8322d" or [200, 50, 45]')
    return int(digits[0:2], 16), int(digits[2:4], 16), int(digits[4:6], 16)
