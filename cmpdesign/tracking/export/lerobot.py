"""Runs as a LeRobotDataset v3.0: one run is one episode; features ``observation.tactile.*``, and optionally images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cmpdesign.errors import CmpDesignError, OutputError, parameter
from cmpdesign.files.atomic import Stage
from cmpdesign.inputs.files import MAX_PIXELS
from cmpdesign.tracking.export.lerobot_tables import (
    DATA_FILE_MB,
    DATA_PATH,
    EPISODES_PATH,
    FILES_A_CHUNK,
    OWN_FEATURES,
    VIDEO_FILE_MB,
    VIDEO_PATH,
    data_table,
    feature_of,
    info_text,
    stats_text,
    video_feature,
    write_episodes,
    write_tasks,
)
from cmpdesign.tracking.export.run_images import require_sources, run_images
from cmpdesign.tracking.export.runs import Run, load_run, require_one_kind
from cmpdesign.tracking.export.statistics import ImageStatistics, Statistics, pooled, statistics_of
from cmpdesign.tracking.export.video import Codec, CodecVideo, require_av
from cmpdesign.tracking.sinks.unfinished import require_pyarrow
from cmpdesign.watch import told

PREFIX = "observation.tactile."
VIDEO_KEY = "observation.images.tactile"
# Full resolution of color, because markers are read from color; every second frame can be decoded alone.
VIDEO_CODEC = Codec("libx264", "yuv444p", {"crf": "12", "g": "2", "bf": "0"})
VIDEO_CODEC_NAME = "h264"
BYTES_A_MB = 1 << 20


@dataclass(frozen=True)
class LeRobotDataSet:
    """The parameters of a data set.

    Attributes:
        fps: frames per second.
        task: task that the runs show, in words.
        robot: type of the robot; None: none.
        images: the runs' sources, one for each run, or none.
        most_pixels: limit of width x height of an image.
    """

    fps: float
    task: str = "contact"
    robot: str | None = None
    images: tuple[str, ...] = ()
    most_pixels: int = MAX_PIXELS


def write_lerobot(runs: Sequence[Path], path: Path, about: LeRobotDataSet) -> int:
    """Write a data set; the data set is complete on disk before it gets its name.

    Args:
        runs: .npz files of ``track`` or of ``reconstruct``, one file for each episode.
        path: the data set's folder; it does not exist.
        about: the parameters.

    Returns:
        The number of frames.

    Raises:
        CmpDesignError: a library is missing, or the runs or their images cannot be used together.
        OutputError: the data set cannot be written, or the folder exists.
    """
    require_pyarrow()
    if about.images:
        require_av()
    require_sources(len(runs), len(about.images))
    require_one_kind(runs)
    if path.exists():
        raise OutputError(f"{path} exists; delete it, or give another name")
    try:
        with Stage(path.parent) as stage:
            staged = stage.folder / "dataset"
            frames = _write_folder(staged, runs, about)
            stage.commit(staged, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from None
    return frames


def _write_folder(folder: Path, runs: Sequence[Path], about: LeRobotDataSet) -> int:
    data, video = _DataFiles(folder), _VideoFiles(folder, about.fps) if about.images else None
    rows: list[dict[str, Any]] = []
    stats: list[dict[str, Statistics]] = []
    features: dict[str, Any] = {}
    first = 0
    try:
        for episode, run_path in enumerate(told(runs, len(runs), "runs")):
            run = load_run(run_path)
            arrays = _columns_of(run, episode, first, about.fps)
            row = {"episode_index": episode, "tasks": [about.task], "length": len(run)}
            row |= data.add(data_table(arrays))
            row |= {"dataset_from_index": first, "dataset_to_index": first + len(run)}
            stats.append({name: statistics_of(values) for name, values in arrays.items()})
            if video is not None:
                row |= video.add(run, about.images[episode], about.most_pixels)
                stats[-1][VIDEO_KEY] = video.statistics
            features = {name: feature_of(v) for name, v in arrays.items() if name not in OWN_FEATURES}
            rows.append(row)
            first += len(run)
    finally:
        data.close()
        if video is not None:
            video.close()
    if video is not None:
        features[VIDEO_KEY] = video_feature(video.shape, about.fps, VIDEO_CODEC_NAME, VIDEO_CODEC.pixels)
    for name in (EPISODES_PATH, "meta/tasks.parquet"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
    write_episodes(folder / EPISODES_PATH, rows, stats)
    write_tasks(folder / "meta/tasks.parquet", about.task)
    info = info_text(features, about.fps, len(runs), first, about.robot)
    (folder / "meta/info.json").write_text(info, encoding="utf-8")
    together = {name: pooled([one[name] for one in stats]) for name in stats[0]}
    (folder / "meta/stats.json").write_text(stats_text(together), encoding="utf-8")
    return first


def _columns_of(run: Run, episode: int, first: int, fps: float) -> dict[str, np.ndarray]:
    """The columns of an episode; ``first`` is the number of its first frame in the data set."""
    index = np.arange(len(run), dtype=np.int64)
    return {PREFIX + name: values for name, values in run.arrays.items()} | {
        "timestamp": (index / fps).astype(np.float32),
        "frame_index": index,
        "episode_index": np.full(len(run), episode, np.int64),
        "index": first + index,
        "task_index": np.zeros(len(run), np.int64),
    }


class _Place:
    """Chunk and file of the next episode: after a file that has reached its size, a new file."""

    def __init__(self) -> None:
        self.number = 0

    def names(self) -> dict[str, int]:
        chunk, file = divmod(self.number, FILES_A_CHUNK)
        return {"chunk_index": chunk, "file_index": file}


class _DataFiles:
    """The tables of the frames, with one row group an episode."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._place = folder, _Place()
        self._writer: Any = None
        self._path = folder

    def add(self, table: Any) -> dict[str, int]:
        """Append an episode; the place of the episode."""
        if self._writer is not None and self._path.stat().st_size >= DATA_FILE_MB * BYTES_A_MB:
            self.close()
            self._place.number += 1
        names = self._place.names()
        if self._writer is None:
            self._path = self._folder / DATA_PATH.format(**names)
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = require_pyarrow().parquet.ParquetWriter(self._path, table.schema)
        self._writer.write_table(table, row_group_size=max(1, table.num_rows))
        return {f"data/{name}": value for name, value in names.items()}

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None


class _VideoFiles:
    """The videos of the images.

    Attributes:
        shape: (H, W, 3) of the frames.
        statistics: of the last episode's images.
    """

    def __init__(self, folder: Path, fps: float) -> None:
        self._folder, self._fps, self._place = folder, fps, _Place()
        self._video: CodecVideo | None = None
        self._path = folder
        self.shape: tuple[int, ...] = ()
        self.statistics: Statistics

    def add(self, run: Run, source: str, most_pixels: int) -> dict[str, Any]:
        """Append an episode's images; the place of the images."""
        if self._video is not None and self._path.stat().st_size >= VIDEO_FILE_MB * BYTES_A_MB:
            self.close()
            self._place.number += 1
        names = self._place.names()
        if self._video is None:
            self._path = self._folder / VIDEO_PATH.format(video_key=VIDEO_KEY, **names)
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._video = CodecVideo(self._path, VIDEO_CODEC, self._fps)
        start, statistics = self._video.frames, ImageStatistics()
        for picture in run_images(run, source, most_pixels):
            self.shape = self.shape or picture.shape
            if picture.shape != self.shape:
                raise CmpDesignError(
                    f"{parameter('images')} {source}: has {picture.shape[1]} x {picture.shape[0]} px, the first source "
                    f"{self.shape[1]} x {self.shape[0]} px; a data set has one size"
                )
            self._video.add(picture)
            statistics.add(picture)
        self.statistics = statistics.result()
        times = {"from_timestamp": start / self._fps, "to_timestamp": self._video.frames / self._fps}
        return {f"videos/{VIDEO_KEY}/{name}": value for name, value in {**names, **times}.items()}

    def close(self) -> None:
        if self._video is not None:
            self._video.close()
            self._video = None
