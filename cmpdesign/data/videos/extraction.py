"""Markers read from many videos and folders of pictures: each shard is a part of one source, cut at key frames."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from cmpdesign import __version__
from cmpdesign.data.files.tables import Row, lost_values, marker_values
from cmpdesign.data.folder import Prepared, file_digest, plan_digest, read_plan
from cmpdesign.data.named_files import named_layouts
from cmpdesign.data.records import FORMAT_EXTRACTION
from cmpdesign.data.videos.pieces import NumberedFrame, Piece, piece_frames, video_pieces
from cmpdesign.errors import CmpDesignError, SourceError
from cmpdesign.files.images import ImageFileError, is_image_file, read_image
from cmpdesign.files.layout_json import layout_to_json, pattern_digest
from cmpdesign.inputs.sources import SourceKind, name_sources
from cmpdesign.reading.read_layout import layout_from_reference
from extractor import Extractor, ImageError, Reference
from extractor.image.input import Channels
from extractor.pipeline import Side
from extractor.presets import Preset

LAYOUT = "layouts/layout.json"
UNREADABLE = "unreadable"
EXTRACTED = {
    "source": "string",
    "frame": "int64",
    "time_s": "double",
    "xy_px": "list of float",
    "cov_px2": "list of float",
    "status": "list of uint8",
    "reason": "list of string",
}


@dataclass(frozen=True)
class FrameReading:
    """Options of the reader; see ``extractor.Extractor``."""

    preset: Preset = "balanced"
    response: Literal["srgb", "linear"] | float | None = None
    side: Side = "designed"
    channels: Channels = "bgr"


@dataclass(frozen=True)
class SourceTask:
    """A source to be cut.

    Attributes:
        name: name as given.
        paths: one video, or pictures.
        frames_a_shard: smallest number of frames of a piece, except for the last piece.
    """

    name: str
    paths: tuple[Path, ...]
    frames_a_shard: int


def name_tasks(sources: Sequence[str], frames_a_shard: int) -> list[SourceTask]:
    """The sources that texts name; each text is a separate source, and a pattern of videos one source for each video.

    Raises:
        SourceError: a text names no file, a camera or a stream.
    """
    tasks = []
    for named in (named for text in sources for named in name_sources([text])):
        if named.kind not in (SourceKind.IMAGES, SourceKind.FILE):
            raise SourceError(f"{named.name}: expected files; a camera or a stream cannot be read in parts")
        name = str(named.paths[0]) if len(named.paths) == 1 else named.name
        tasks.append(SourceTask(name, tuple(path.resolve() for path in named.paths), frames_a_shard))
    return tasks


def index_source(task: SourceTask) -> dict[str, Any]:
    """A source in plan.json: its digest, and its pieces as [first, frames, start, end].

    Raises:
        CmpDesignError: the source cannot be read.
    """
    if len(task.paths) == 1 and not is_image_file(task.paths[0]):
        kind, pieces = "video", video_pieces(task.paths[0], task.frames_a_shard)
    else:
        kind, pieces = "pictures", _cut_pictures(len(task.paths), task.frames_a_shard)
    if not pieces:
        raise SourceError(f"{task.name}: holds no frame")
    digest = hashlib.sha256()
    for path in task.paths:
        digest.update(bytes.fromhex(file_digest(path)))
    return {
        "name": task.name,
        "kind": kind,
        "location": [str(path) for path in task.paths],
        "sha256": digest.hexdigest(),
        "frames": sum(piece.frames for piece in pieces),
        "ranges": [[piece.first, piece.frames, piece.start, piece.end] for piece in pieces],
    }


def _cut_pictures(count: int, frames_a_shard: int) -> list[Piece]:
    starts = range(0, count, frames_a_shard)
    return [Piece(start, min(frames_a_shard, count - start)) for start in starts]


def prepare_extraction(
    layout: Reference, sources: Sequence[Mapping[str, Any]], options: FrameReading
) -> Prepared:
    """The plan of an extraction from indexed sources."""
    written = layout_from_reference(layout)
    plan = {
        "format": FORMAT_EXTRACTION,
        "version": 1,
        "made_with": f"cmpdesign {__version__}",
        "frames": sum(source["frames"] for source in sources),
        "layout": {"file": LAYOUT, "digest": pattern_digest(written)},
        "reading": asdict(options),
        "sources": list(sources),
    }
    return Prepared(plan | {"digest": plan_digest(plan)}, {LAYOUT: layout_to_json(written).encode()})


def range_rows(folder: Path, plan: Mapping[str, Any], number: int) -> list[Row]:
    """The rows of one shard: every frame is read independently of the other frames.

    Raises:
        CmpDesignError: the source was changed after it was cut.
    """
    source, piece = _piece(plan, number)
    extractor = _extractor(folder, plan["digest"])
    rows: list[Row] = []
    for frame in _frames(source, piece):
        values = lost_values(len(extractor.layout.layer), UNREADABLE)
        if frame.image is not None:
            with suppress(ImageError):  # too small: one frame does not end all
                values = marker_values([extractor.extract(frame.image)])
        rows.append({"source": source["name"], "frame": frame.number, "time_s": frame.time_s, **values})
    if len(rows) != piece.frames:
        raise CmpDesignError(
            f"{source['name']}: frames {piece.first} to {piece.first + piece.frames - 1} are {len(rows)} frames now; "
            "the file was changed, extract it into a new folder"
        )
    return rows


def _piece(plan: Mapping[str, Any], number: int) -> tuple[Mapping[str, Any], Piece]:
    for source in plan["sources"]:
        if number < len(source["ranges"]):
            return source, Piece(*source["ranges"][number])
        number -= len(source["ranges"])
    raise CmpDesignError(f"shard {number} does not exist")


@lru_cache(maxsize=2)
def _extractor(folder: Path, digest: str) -> Extractor:
    """The reader of a plan, kept from shard to shard; the digest distinguishes plans in one folder."""
    plan = read_plan(folder)
    reading = FrameReading(**plan["reading"])
    layout = named_layouts(folder, plan)[""]
    return Extractor(layout, reading.preset, reading.response, reading.side, reading.channels)


def _frames(source: Mapping[str, Any], piece: Piece) -> Iterator[NumberedFrame]:
    if source["kind"] == "video":
        yield from piece_frames(Path(source["location"][0]), piece)
        return
    for number in range(piece.first, piece.first + piece.frames):
        try:
            image = read_image(source["location"][number])
        except ImageFileError:
            image = None
        yield NumberedFrame(number, float("nan"), image)
