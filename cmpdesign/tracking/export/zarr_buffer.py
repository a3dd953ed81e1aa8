"""Runs as a replay buffer in the form of Diffusion Policy: a Zarr group (format 2) of data/<key> and meta/episode_ends.

``data/tactile_<name>`` has the frames of all runs one after another; ``meta/episode_ends`` (episodes,) int64 holds the
end of each run.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.files.atomic import Stage
from cmpdesign.inputs.files import MAX_PIXELS
from cmpdesign.libraries import extra
from cmpdesign.tracking.export.run_images import require_sources, run_images
from cmpdesign.tracking.export.runs import load_run, require_one_kind
from cmpdesign.watch import told

PREFIX = "tactile_"
IMAGE_KEY = "tactile_image"
CHUNK_FRAMES = 256


def require_zarr() -> Any:
    """The module zarr.

    Raises:
        MissingLibraryError: it is not installed.
    """
    with extra("export"):
        import zarr
    return zarr


def write_zarr(
    runs: Sequence[Path], path: Path, images: Sequence[str] = (), most_pixels: int = MAX_PIXELS
) -> int:
    """Write a replay buffer; the buffer is complete on disk before it gets its name.

    Args:
        runs: .npz files of ``track`` or of ``reconstruct``, one file for each episode.
        path: the group's folder; it does not exist.
        images: the runs' sources, for data/tactile_image (N, H, W, 3) uint8 RGB; none: no images.
        most_pixels: limit of width x height of an image.

    Returns:
        The number of frames.

    Raises:
        CmpDesignError: zarr is missing, or the runs or their images cannot be used together.
        OutputError: the buffer cannot be written, or the folder exists.
    """
    require_zarr()
    require_sources(len(runs), len(images))
    kind = require_one_kind(runs)
    if path.exists():
        raise OutputError(f"{path} exists; delete it, or give another name")
    try:
        with Stage(path.parent) as stage:
            staged = stage.folder / "buffer"
            buffer = _Buffer(staged)
            for place, run_path in enumerate(told(runs, len(runs), "runs")):
                buffer.add_run(run_path, images[place] if images else None, most_pixels)
            frames = buffer.finish({"format": kind.format, "digest": kind.digest})
            stage.commit(staged, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from None
    return frames


class _Buffer:
    """A group that grows run by run."""

    def __init__(self, folder: Path) -> None:
        self._group = require_zarr().open_group(str(folder), mode="w", zarr_format=2)
        self._data = self._group.create_group("data")
        self._ends: list[int] = []

    def add_run(self, path: Path, source: str | None, most_pixels: int) -> None:
        run = load_run(path)
        for name, values in run.arrays.items():
            self._append(PREFIX + name, values, CHUNK_FRAMES)
        if source is not None:
            for picture in run_images(run, source, most_pixels):
                self._append(IMAGE_KEY, picture[None, :, :, ::-1], 1)
        self._ends.append((self._ends[-1] if self._ends else 0) + len(run))

    def _append(self, key: str, values: NDArray[Any], chunk_frames: int) -> None:
        if key in self._data:
            if self._data[key].shape[1:] != values.shape[1:]:
                raise CmpDesignError(
                    f"{key}: frames of {values.shape[1:]} after {self._data[key].shape[1:]}; one buffer has one size"
                )
            self._data[key].append(values)
            return
        chunks = (chunk_frames, *values.shape[1:])
        array = self._data.create_array(key, shape=values.shape, dtype=values.dtype, chunks=chunks)
        array[:] = values

    def finish(self, attributes: dict[str, str]) -> int:
        ends = np.array(self._ends, np.int64)
        meta = self._group.create_group("meta")
        meta.create_array("episode_ends", shape=ends.shape, dtype=ends.dtype, chunks=ends.shape)[:] = ends
        self._group.attrs.update(attributes)
        return int(ends[-1])
