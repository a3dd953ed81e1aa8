"""Data sets larger than a machine: many shards of rendered frames, or of frames read from videos.

In: a plan (TOML), or videos and a layout; processes of this machine, or the workers of a dask cluster. Out: a folder of
shards: images as WebDataset tar, truth, markers and parameters as Parquet; ``load`` reads the folder.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmpdesign.data.integrity import CheckedDataSet as CheckedDataSet
    from cmpdesign.data.integrity import check as check
    from cmpdesign.data.reader import DataSet as DataSet
    from cmpdesign.data.reader import Frame as Frame
    from cmpdesign.data.reader import load as load

_HOMES = {
    "CheckedDataSet": "cmpdesign.data.integrity",
    "DataSet": "cmpdesign.data.reader",
    "Frame": "cmpdesign.data.reader",
    "check": "cmpdesign.data.integrity",
    "load": "cmpdesign.data.reader",
}
__all__ = ["CheckedDataSet", "DataSet", "Frame", "check", "load"]


def __getattr__(name: str) -> Any:
    """Load a module at its first use: the reader needs pyarrow."""
    if name not in _HOMES:
        raise AttributeError(f"module 'cmpdesign.data' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
