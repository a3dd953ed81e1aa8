"""The images of sources one by one, each with a unique name; an unreadable image keeps its place."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from cmpdesign.errors import SourceError
from cmpdesign.files.images import is_image_file, to_png
from cmpdesign.inputs.files import read_file
from cmpdesign.inputs.sources import NamedSource, SourceKind
from cmpdesign.tracking.sources import Reading, open_named


class SourcePicture(NamedTuple):
    """An image as a file: name without folder, and content."""

    name: str
    content: bytes


@dataclass(frozen=True, eq=False)
class SourceImage:
    """One image of a source.

    Attributes:
        name: its path, or the source's name and the number of the frame.
        stem: a name for files that belong to the image; unique among all images of a run.
        image: (H, W, 3) BGR, uint8 or uint16; None where it cannot be read.
        problem: reason for a missing image, or "".
        path: the image's own file; None for a frame of a video, a camera or a stream.
    """

    name: str
    stem: str
    image: Any
    problem: str
    path: Path | None

    def picture(self) -> SourcePicture:
        """The image's own file, unchanged; for a frame, a PNG.

        Raises:
            InputError: the file can no longer be read.
        """
        if self.path is None:
            return SourcePicture(f"{self.stem}.png", to_png(self.image))
        return SourcePicture(f"{self.stem}{self.path.suffix}", read_file(self.path))


def count_images(sources: Iterable[NamedSource], frames: int | None) -> int | None:
    """The number of images of ``source_images``; None where a video does not state its number of frames.

    Args:
        sources: from ``name_sources``.
        frames: see ``source_images``.
    """
    total = 0
    for source in sources:
        if source.kind is SourceKind.IMAGES:
            total += len(source.paths)
        elif source.address:
            total += frames or 1
        elif not is_image_file(source.paths[0]):
            return None
        else:
            total += 1
    return total


def source_images(
    sources: Sequence[NamedSource],
    frames: int | None = None,
    how: Reading = Reading(),  # noqa: B008
) -> Iterator[SourceImage]:
    """The images of all sources; a source that cannot be opened counts as one image that cannot be read.

    Args:
        sources: from ``name_sources``.
        frames: number of frames of each video, camera or stream; None: all of a video, one of a camera or stream.
        how: how the sources are read.
    """
    stems: set[str] = set()
    for source in sources:
        try:
            opened = open_named(source, how)
        except SourceError as error:
            yield SourceImage(source.name, _new_stem(source.name, stems), None, str(error), None)
            continue
        is_files = source.kind is SourceKind.IMAGES
        before = len(stems)
        limit = None if is_files else frames or (1 if opened.is_live else None)
        for index, frame in enumerate(islice(opened.frames(), limit)):
            name = f"{source.name} frame {index}" if frame.path is None else str(frame.path)
            stem = f"{_stem_of(source)}.{index}" if frame.path is None else frame.path.stem
            yield SourceImage(name, _new_stem(stem, stems), frame.image, frame.problem, frame.path)
        problem = opened.ended_early or ("no frame could be read" if len(stems) == before else "")
        if problem:
            problem = f"{source.name}: {problem}"
            yield SourceImage(source.name, _new_stem(source.name, stems), None, problem, None)


def _stem_of(source: NamedSource) -> str:
    if source.kind is SourceKind.FILE:
        return source.paths[0].stem
    return f"camera{source.address}" if source.kind is SourceKind.CAMERA else "stream"


def _new_stem(stem: str, taken: set[str]) -> str:
    """The stem, numbered where an earlier image has the same stem."""
    name, number = stem, 1
    while name in taken:
        number += 1
        name = f"{stem}-{number}"
    taken.add(name)
    return name
