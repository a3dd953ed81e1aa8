"""The schemas of a data set's documents: plans, records of shards, and the manifest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from cmpdesign.inputs.names import Line, Name
from cmpdesign.inputs.options import Preset
from cmpdesign.inputs.records import MAX_COUNT, Digest, Record

FORMAT_FRAMES, FORMAT_EXTRACTION = "cmp-dataset-plan", "cmp-extraction-plan"
FORMAT_RECORD, FORMAT_MANIFEST = "cmp-dataset-shard", "cmp-dataset"
MAX_FRAMES = 10**9
MAX_FRAMES_A_SHARD = 100_000
MAX_DESIGNS = 1000
MAX_DIGITS = 6  # of a shard's number
Count = Annotated[int, Field(ge=0, le=MAX_COUNT)]
Stamp = Annotated[int, Field(ge=-MAX_COUNT * 8, le=MAX_COUNT * 8)]
InputName = Annotated[str, Field(pattern=r"^inputs/[0-9a-f]{16}(\.[a-z]{3,4})?$")]
PlainName = Annotated[str, Field(pattern=r"^[^/\\\x00-\x1f]+$", max_length=200)]


class ImageTable(Record):
    """[image]: the encoding of a frame's picture."""

    kind: Literal["jpeg", "png"] = Field(
        "jpeg", description="JPEG keeps the full resolution of color (4:4:4)."
    )
    quality: int = Field(95, ge=1, le=100, description="Of JPEG.")


class MarkersTable(Record):
    """[markers]: the reading of the markers from the encoded picture."""

    read: bool = True
    preset: Preset = "balanced"


class DesignRecord(Record):
    """A design of a plan: its layout file and the digest of the pattern."""

    name: PlainName
    layout: Annotated[str, Field(pattern=r"^layouts/[^/\\\x00-\x1f]+\.json$", max_length=220)]
    digest: Digest


class FramesPlan(Record):
    """plan.json of rendered frames."""

    format: Literal["cmp-dataset-plan"]
    version: Literal[1]
    made_with: Name
    name: Name
    description: Line
    frames: int = Field(ge=1, le=MAX_FRAMES)
    frames_a_shard: int = Field(ge=1, le=MAX_FRAMES_A_SHARD)
    seed: int = Field(ge=0)
    image: ImageTable
    markers: MarkersTable
    designs: list[DesignRecord] = Field(min_length=1, max_length=MAX_DESIGNS)
    weights: list[float] | None
    largest_strain: float | None
    inputs: dict[InputName, Digest]
    scene: dict[str, Any]
    digest: Digest

    def shard_frames(self) -> list[int]:
        """Number of frames of every shard."""
        return [self.frames_a_shard] * (self.frames // self.frames_a_shard)


class LayoutRecord(Record):
    """The layout of an extraction."""

    file: Literal["layouts/layout.json"]
    digest: Digest


class ReadingRecord(Record):
    """Options of the reader."""

    preset: Preset
    response: Literal["srgb", "linear"] | float | None
    side: Literal["designed", "front", "back", "either"]
    channels: Literal["bgr", "rgb"]


class SourceRecord(Record):
    """A source of an extraction, and its pieces as [first, frames, start, end]."""

    name: Annotated[str, Field(max_length=100_000)]
    kind: Literal["video", "pictures"]
    location: list[Annotated[str, Field(min_length=1, max_length=10_000)]] = Field(min_length=1)
    sha256: Digest
    frames: int = Field(ge=1, le=MAX_FRAMES)
    ranges: list[Annotated[list[Stamp], Field(min_length=4, max_length=4)]] = Field(min_length=1)


class ExtractionPlan(Record):
    """plan.json of markers that are read from sources."""

    format: Literal["cmp-extraction-plan"]
    version: Literal[1]
    made_with: Name
    frames: int = Field(ge=1, le=MAX_FRAMES)
    layout: LayoutRecord
    reading: ReadingRecord
    sources: list[SourceRecord] = Field(min_length=1)
    digest: Digest

    def shard_frames(self) -> list[int]:
        """Number of frames of every shard."""
        return [piece[1] for source in self.sources for piece in source.ranges]


class FileRecord(Record):
    """A file of a shard."""

    bytes: Count
    sha256: Digest


class ShardRecord(Record):
    """shards/000012.json: the files of a finished shard. Numbers of frames are those of the plan."""

    format: Literal["cmp-dataset-shard"]
    version: Literal[1]
    shard: Count
    digest: Digest
    frames: Count
    redrawn: Count | None = None
    files: dict[str, FileRecord]

    def listed(self) -> dict[str, Any]:
        """The shard in the manifest."""
        return self.model_dump(exclude={"format", "version", "digest"}, exclude_none=True)


class ListedShard(Record):
    """A shard in the manifest."""

    shard: Count
    frames: Count
    redrawn: Count | None = None
    files: dict[str, FileRecord]

    def record(self, digest: str) -> ShardRecord:
        """The record of the shard."""
        return ShardRecord(
            format="cmp-dataset-shard",
            version=1,
            shard=self.shard,
            digest=digest,
            frames=self.frames,
            redrawn=self.redrawn,
            files=self.files,
        )


class Manifest(Record):
    """manifest.json."""

    format: Literal["cmp-dataset"]
    version: Literal[1]
    plan: Digest
    complete: bool
    frames: Count
    shards: list[ListedShard]


PLAN_KINDS: Mapping[str, type[FramesPlan | ExtractionPlan]] = {
    FORMAT_FRAMES: FramesPlan,
    FORMAT_EXTRACTION: ExtractionPlan,
}
