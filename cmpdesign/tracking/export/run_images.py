"""The images of a run's frames, from the source of the run."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.files import MAX_PIXELS
from cmpdesign.tracking.export.runs import Run
from cmpdesign.tracking.export.video import pixels_of
from cmpdesign.tracking.sources import Reading, open_source

Picture = NDArray[np.uint8]


def run_images(run: Run, source: str, most_pixels: int = MAX_PIXELS) -> Iterator[Picture]:
    """The image of every frame of a run, (H, W, 3) uint8 BGR; black where the source has no image.

    Args:
        run: the run.
        source: a video or a folder of images, see ``open_source``.
        most_pixels: limit of width x height of an image.

    Raises:
        CmpDesignError: the source cannot be opened, is live, has fewer frames than the run, or frames of two sizes.
    """
    opened = open_source(source, Reading(max_pixels=most_pixels))
    if opened.is_live:
        raise CmpDesignError(
            f"{parameter('images')} {source}: frames of a camera or stream cannot be read again; give a video or "
            "a folder of images"
        )
    wanted = set(run.frame.tolist())
    shape: tuple[int, ...] | None = None
    waiting = found = 0
    for index, frame in enumerate(opened.frames()):
        if index not in wanted:
            continue
        found += 1
        if frame.image is None and shape is None:
            waiting += 1  # until the size is known
            continue
        picture = np.zeros(shape, np.uint8) if frame.image is None and shape else pixels_of(frame.image)
        shape = shape or picture.shape
        if picture.shape != shape:
            raise CmpDesignError(
                f"{parameter('images')} {source}: frame {index} has {picture.shape[1]} x {picture.shape[0]} px, "
                f"the first {shape[1]} x {shape[0]} px; a video has one size"
            )
        for _ in range(waiting):
            yield np.zeros(shape, np.uint8)
        waiting = 0
        yield picture
    if found < len(wanted) or waiting:
        raise CmpDesignError(
            f"{parameter('images')} {source}: has {found - waiting} of the {len(wanted)} frames of {run.path}"
        )


def require_sources(runs: int, sources: int) -> None:
    """Check that there is one source of images for each run, or none.

    Raises:
        CmpDesignError: another number.
    """
    if sources not in (0, runs):
        raise CmpDesignError(
            f"{parameter('images')} is given {sources} times for {runs} runs; give one for each run, in order"
        )
