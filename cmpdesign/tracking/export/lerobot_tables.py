"""The tables and documents of a LeRobotDataset v3.0, by its documented layout."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign import __version__
from cmpdesign.tracking.export.statistics import Statistics
from cmpdesign.tracking.sinks.unfinished import require_pyarrow

VERSION = "v3.0"
FILES_A_CHUNK, DATA_FILE_MB, VIDEO_FILE_MB = 1000, 100, 200  # LeRobot's defaults
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
# Columns that every data set has, and their types.
OWN_FEATURES = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
Arrays = Mapping[str, NDArray[Any]]


def feature_of(values: NDArray[Any]) -> dict[str, Any]:
    """The description of an array (F, ...) in info.json."""
    names = [f"{axis}" for axis in "xyz"[: values.shape[-1]]] if values.ndim == 3 else None
    return {"dtype": values.dtype.name, "shape": list(values.shape[1:] or (1,)), "names": names}


def video_feature(shape: Sequence[int], fps: float, codec: str, pixels: str) -> dict[str, Any]:
    """The description of a video of frames (H, W, 3) in info.json."""
    about = {
        "video.height": shape[0],
        "video.width": shape[1],
        "video.codec": codec,
        "video.pix_fmt": pixels,
        "video.is_depth_map": False,
        "video.fps": fps,
        "video.channels": 3,
        "has_audio": False,
    }
    return {
        "dtype": "video",
        "shape": list(shape),
        "names": ["height", "width", "channels"],
        "info": about,
    }


def info_text(features: Mapping[str, Any], fps: float, episodes: int, frames: int, robot: str | None) -> str:
    """The text of meta/info.json."""
    has_video = any(feature["dtype"] == "video" for feature in features.values())
    own = {name: {"dtype": dtype, "shape": [1], "names": None} for name, dtype in OWN_FEATURES.items()}
    info = {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": FILES_A_CHUNK,
        "data_files_size_in_mb": DATA_FILE_MB,
        "video_files_size_in_mb": VIDEO_FILE_MB,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": DATA_PATH,
        "video_path": VIDEO_PATH if has_video else None,
        "features": {**features, **own},
    }
    return json.dumps(info, indent=4) + "\n"


def data_table(arrays: Arrays) -> Any:
    """The table of an episode's frames: (F,) as numbers, (F, M) as lists, (F, M, k) as lists of lists."""
    arrow = require_pyarrow()
    return arrow.table({name: _nested(values) for name, values in arrays.items()})


def _nested(values: NDArray[Any]) -> Any:
    """An Arrow array with one entry a frame; NaN stays NaN."""
    arrow = require_pyarrow()
    array = arrow.array(np.ascontiguousarray(values).reshape(-1))
    if values.ndim == 2:
        return arrow.FixedSizeListArray.from_arrays(array, values.shape[1])
    for size in values.shape[:0:-1]:
        offsets = np.arange(0, len(array) + 1, size, dtype=np.int32)
        array = arrow.ListArray.from_arrays(offsets, array)
    return array


def write_tasks(path: Path, task: str) -> None:
    """Write meta/tasks.parquet: one task, its text as the index of the table, as pandas reads it."""
    arrow = require_pyarrow()
    text_column = {"pandas_type": "unicode", "numpy_type": "object"}
    about = {
        "index_columns": ["__index_level_0__"],
        "column_indexes": [
            {"name": None, "field_name": None, **text_column, "metadata": {"encoding": "UTF-8"}}
        ],
        "columns": [
            {
                "name": "task_index",
                "field_name": "task_index",
                "pandas_type": "int64",
                "numpy_type": "int64",
                "metadata": None,
            },
            {"name": None, "field_name": "__index_level_0__", **text_column, "metadata": None},
        ],
        "creator": {"library": "cmpdesign", "version": __version__},
        "pandas_version": "2.0.0",
    }
    table = arrow.table({"task_index": arrow.array([0], arrow.int64()), "__index_level_0__": [task]})
    arrow.parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(about)}), path)


def write_episodes(
    path: Path, rows: Sequence[Mapping[str, Any]], stats: Sequence[Mapping[str, Statistics]]
) -> None:
    """Write meta/episodes: one row an episode, with its place in the files and its statistics."""
    arrow = require_pyarrow()
    full = [
        dict(row)
        | {
            f"stats/{feature}/{name}": values
            for feature, one in of_row.items()
            for name, values in one.to_json().items()
        }
        | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        for row, of_row in zip(rows, stats, strict=True)
    ]
    arrow.parquet.write_table(arrow.Table.from_pylist(full), path)


def stats_text(stats: Mapping[str, Statistics]) -> str:
    """The text of meta/stats.json."""
    return json.dumps({name: one.to_json() for name, one in stats.items()}, indent=4) + "\n"
