"""The document of the commands that make data sets."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from cmpdesign.documents.document import Document


class DatasetDocument(Document):
    """The present contents of the data set of ``dataset`` or ``extract``."""

    format: Literal["cmp-dataset-run"] = "cmp-dataset-run"
    version: Literal[1] = 1
    written: str
    frames: int
    shards: int = Field(description="Finished shards.")
    of_shards: int = Field(description="Shards of the whole plan.")
    redrawn: int = Field(description="Drawn parameters that could not be rendered and were drawn anew.")
    bytes: int = Field(description="Total size of the finished shards' files.")


class DatasetCheckDocument(Document):
    """The comparison of a data set's files with their digests, by ``dataset --check``."""

    format: Literal["cmp-dataset-check"] = "cmp-dataset-check"
    version: Literal[1] = 1
    folder: str
    shards: int = Field(description="Finished shards whose files are unchanged.")
    of_shards: int = Field(description="Shards of the whole plan.")
    frames: int = Field(description="Frames of these shards.")
    bytes: int = Field(description="Total size of these shards' files.")
    problems: list[str] = Field(description="One sentence on each changed or missing file.")
