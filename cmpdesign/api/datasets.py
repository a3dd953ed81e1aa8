"""Data sets made and read: ``dataset`` and ``extract`` of the command line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Unpack

from cmpdesign import documents
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.options import Written, settled
from cmpdesign.tracking.jobs.options import ReadingOptions

if TYPE_CHECKING:
    from cmpdesign.api.layouts import AnyLayout


def dataset(
    plan: str | Path,
    output: Annotated[str | Path | None, Written(metavar="FOLDER")] = None,
    *,
    shards: Annotated[str | int | None, Written(metavar="N|A:B")] = None,
    scheduler: Annotated[str, Written(metavar="local|dask=ADDRESS")] = "local",
    workers: Annotated[int | None, Written(least=1)] = None,
    inputs_from: Annotated[Sequence[str | Path], Written(metavar="FOLDER")] = (),
    check: bool = False,
) -> documents.data.DatasetDocument | documents.data.DatasetCheckDocument:
    """Make a data set: pictures, truth, markers, forces and parameters of the frames that a plan names.

    The same call continues an interrupted data set. A program that calls this with the scheduler "local" needs
    ``if __name__ == "__main__":`` around its work, because every worker is a new process.

    >>> cmpdesign.dataset("plan.toml", "pressed", shards=2).frames
    >>> frames = cmpdesign.data.load("pressed")
    >>> frames[0].image, frames[0].arrays["true_xy_px"], frames[0].values["force_n"]

    Args:
        plan: a TOML file, or the name of a plan template; with ``check`` the folder of a data set.
        output: data set: a new folder, or one of the same plan.
        shards: only the first N shards, or those from A to below B; None: all.
        scheduler: the machine that works: "local", this machine, or a dask scheduler by address or scheduler file.
        workers: number of processes on this machine; None: one for each core.
        inputs_from: folder, beside the plan's, whose pictures and height maps the plan may take; they become a part of
            the data set.
        check: only compare all files of a data set with their digests.

    Raises:
        CmpDesignError: the plan cannot be carried out, or workers were lost.
        OutputError: a file cannot be written; finished shards are kept.
    """
    from cmpdesign.data import check as check_folder
    from cmpdesign.data.run import make_dataset, parse_shards
    from cmpdesign.data.schedule.schedulers import parse_scheduler
    from cmpdesign.design.templates import find_plan

    if check:
        if output or shards or inputs_from:
            raise CmpDesignError(
                f"{parameter('check')} takes the folder of a data set alone; leave out the other options"
            )
        return documents.data.DatasetCheckDocument.of(check_folder(plan), folder=str(plan))
    if output is None:
        raise CmpDesignError(f"{parameter('output')} is missing; give the folder of the data set")
    where = parse_scheduler(scheduler, workers)
    made = make_dataset(find_plan(plan), output, parse_shards(shards), where, inputs_from)
    return documents.data.DatasetDocument.of(made, written=str(output))


def extract(
    layout: AnyLayout,
    sources: str | Path | Sequence[str | Path],
    output: Annotated[str | Path, Written(metavar="FOLDER")],
    *,
    frames_a_shard: Annotated[int, Written(least=1)] = 1000,
    scheduler: Annotated[str, Written(metavar="local|dask=ADDRESS")] = "local",
    workers: Annotated[int | None, Written(least=1)] = None,
    **reading: Unpack[ReadingOptions],
) -> documents.data.DatasetDocument:
    """Read the markers of every frame of many sources into Parquet files, each frame independently of the others.

    >>> cmpdesign.extract("layout.json", ["monday/*.mp4", "tuesday/*.mp4"], "markers")
    >>> cmpdesign.data.load("markers").table(["source", "frame", "time_s", "xy_px"])

    Args:
        layout: the pattern's layout.json; or a layout, a ``Reference``, the JSON object of a layout file.
        sources: videos, folders of pictures, patterns such as "run*/*.mp4".
        output: data set: a new folder, or one of the same sources.
        frames_a_shard: frames in a shard; a video is cut at the next key frame.
        scheduler, workers: see ``dataset``.
        reading: see ``ReadingOptions``.

    Raises:
        CmpDesignError, extractor.ExtractorError: a layout or a source that cannot be read, or workers were lost.
        OutputError: a file cannot be written; finished shards are kept.
    """
    from cmpdesign.api.layouts import reference_from
    from cmpdesign.data.run import extract_markers
    from cmpdesign.data.schedule.schedulers import parse_scheduler
    from cmpdesign.data.videos.extraction import FrameReading

    texts = [str(text) for text in ([sources] if isinstance(sources, str | Path) else sources)]
    how, where = FrameReading(**settled(ReadingOptions, reading)), parse_scheduler(scheduler, workers)
    made = extract_markers(reference_from(layout), texts, output, how, where, frames_a_shard)
    return documents.data.DatasetDocument.of(made, written=str(output))
