"""The document of the commands that make data sets."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from cmpdesign.cli.documents.document import Document


class DatasetDocument(Document):
    """What the data set of ``dataset`` or ``extract`` holds now."""

    format: Literal["cmp-dataset-run"] = "cmp-dataset-run"
    version: Literal[1] = 1
    written: str
    frames: int
    shards: int = Field(description="Finished ones.")
    of_shards: int = Field(description="Shards of the whole plan.")
    redrawn: int = Field(description="Draws that could not be rendered, and were drawn anew.")
    bytes: int = Field(description="Of the finished shards' files.")
