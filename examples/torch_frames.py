"""A data set of ``cmpdesign dataset`` as an IterableDataset of PyTorch: pictures with the forces and the moved markers.

    frames = TactileFrames("pressed", seed=1)
    for epoch in range(10):
        frames.epoch = epoch
        for image, target in DataLoader(frames, batch_size=32, num_workers=4, persistent_workers=False):
            loss = criterion(model(image.float() / 255), target["force_n"])

Complete shards are distributed: no two workers, and no two machines of a distributed training, read the same shard.
Frames are shuffled in a buffer, because the frames of a shard follow each other.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from torch.utils.data import IterableDataset, get_worker_info

import cmpdesign.data

BUFFER = 256  # frames


class TactileFrames(IterableDataset):
    """Yields (image (3, H, W) uint8 RGB, targets), in a different order in every epoch.

    Args:
        folder: the data set.
        seed: seed of the order.
        rank, machines: number of this process, and number of processes, which share the shards; as of
            torch.distributed.

    Attributes:
        epoch: set this number before each epoch; it determines the order.
    """

    def __init__(self, folder: str | Path, seed: int = 0, rank: int = 0, machines: int = 1) -> None:
        super().__init__()
        self._frames = cmpdesign.data.load(folder)
        self._seed, self._rank, self._machines = seed, rank, machines
        self.epoch = 0

    def __iter__(self) -> Iterator[tuple[np.ndarray, dict[str, Any]]]:
        worker = get_worker_info()
        own, workers = (0, 1) if worker is None else (worker.id, worker.num_workers)
        order = np.random.default_rng([self._seed, self.epoch]).permutation(self._frames.shards)
        share = order[self._rank :: self._machines][own::workers]
        rng = np.random.default_rng([self._seed, self.epoch, self._rank, own])
        for frame in shuffled(self._frames.frames(share.tolist()), BUFFER, rng):
            yield sample(frame)


def shuffled(frames: Iterator[Any], size: int, rng: np.random.Generator) -> Iterator[Any]:
    """The frames in random order, of which ``size`` are in memory."""
    kept: list[Any] = []
    for frame in frames:
        if len(kept) < size:
            kept.append(frame)
            continue
        place = int(rng.integers(size))
        yield kept[place]
        kept[place] = frame
    yield from (kept[place] for place in rng.permutation(len(kept)))


def sample(frame: cmpdesign.data.Frame) -> tuple[np.ndarray, dict[str, Any]]:
    """The targets of a model, as arrays, which PyTorch converts to tensors."""
    places_mm = frame.arrays["true_xyz_mm"].copy()  # of the markers; less the layout's places: their motion
    return np.ascontiguousarray(frame.image[:, :, ::-1].transpose(2, 0, 1)), {
        "force_n": np.array(frame.values["force_n"], np.float32),
        "moment_nmm": np.array(frame.values["moment_nmm"], np.float32),
        "marker_xyz_mm": places_mm,
        "frame": frame.values["frame"],
    }
