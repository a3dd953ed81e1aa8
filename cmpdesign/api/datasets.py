"""Data sets made and read: ``dataset`` and ``extract`` of the command line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.api.layouts import reference_from

if TYPE_CHECKING:
    from cmpdesign.data.reader import DataSet
    from cmpdesign.layout.layout import Layout as AnyLayout
    from extractor import LayoutLike


def dataset(
    plan: str | Path,
    output: str | Path,
    *,
    shards: str | int | None = None,
    scheduler: str = "local",
    workers: int | None = None,
    inputs_from: Sequence[str | Path] = (),
) -> DataSet:
    """Make a data set, as the command ``dataset`` does; the same call continues an interrupted data set.

    A program that calls this with the scheduler "local" needs ``if __name__ == "__main__":`` around its work, because
    every worker is a new process.

    >>> frames = cmpdesign.dataset("plan.toml", "pressed", shards=2)
    >>> frames[0].image, frames[0].arrays["true_xy_px"], frames[0].values["force_n"]

    Args:
        plan: a TOML file, or the name of a plan template.
        output: a new folder, or the folder of a data set of the same plan.
        shards: the first N shards, or "A:B", the shards from A to below B; None: all.
        scheduler: "local", or "dask=ADDRESS", the address of a dask scheduler or its scheduler file.
        workers: processes on this machine; None: one for each core.
        inputs_from: folders, beside the plan's own, whose height maps and pictures the plan may name. These files
            become a part of the data set.

    Returns:
        The finished shards, see ``cmpdesign.data.load``; ``cmpdesign.data.check`` compares all files with their
        digests.

    Raises:
        CmpDesignError: the plan cannot be carried out, or workers were lost.
        OutputError: a file cannot be written; finished shards are kept.
    """
    from cmpdesign.data import load
    from cmpdesign.data.run import make_dataset, parse_shards
    from cmpdesign.data.schedule.schedulers import parse_scheduler
    from cmpdesign.design.templates import find_plan

    where = parse_scheduler(scheduler, workers)
    make_dataset(find_plan(plan), output, parse_shards(shards), where, inputs_from)
    return load(output)


def extract(
    layout: LayoutLike | AnyLayout,
    sources: str | Path | Sequence[str | Path],
    output: str | Path,
    *,
    frames_a_shard: int = 1000,
    scheduler: str = "local",
    workers: int | None = None,
    **reading: Any,
) -> DataSet:
    """Read the markers of every frame of many sources, as the command ``extract`` does; see also ``dataset``.

    >>> run = cmpdesign.extract("layout.json", ["monday/*.mp4", "tuesday/*.mp4"], "markers")
    >>> run.table(["source", "frame", "time_s", "xy_px"])

    Args:
        layout: see ``track``.
        sources: videos, folders of pictures, patterns such as "run*/*.mp4"; each frame is read independently.
        output: a new folder, or the folder of a data set of the same sources.
        frames_a_shard: number of frames in a shard; a video is cut at the next key frame.
        scheduler, workers: see ``dataset``.
        reading: preset, response, side, channels; see ``extractor.Extractor``.

    Raises:
        CmpDesignError, extractor.ExtractorError: a layout or a source that cannot be read, or workers were lost.
        OutputError: a file cannot be written; finished shards are kept.
    """
    from cmpdesign.data import load
    from cmpdesign.data.run import extract_markers
    from cmpdesign.data.schedule.schedulers import parse_scheduler
    from cmpdesign.data.videos.extraction import FrameReading

    texts = [sources] if isinstance(sources, str | Path) else sources
    extract_markers(
        reference_from(layout),
        [str(text) for text in texts],
        output,
        FrameReading(**reading),
        parse_scheduler(scheduler, workers),
        frames_a_shard,
    )
    return load(output)
