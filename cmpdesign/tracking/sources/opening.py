"""Opening of the sources that texts name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cmpdesign.errors import SourceError, parameter
from cmpdesign.files.images import is_image_file
from cmpdesign.inputs.files import path_exists
from cmpdesign.inputs.sources import NamedSource, SourceKind, name_sources
from cmpdesign.tracking.sources.frame_source import FrameSource, Reading
from cmpdesign.tracking.sources.live import StreamSource, open_camera
from cmpdesign.tracking.sources.pictures import ImagesSource
from cmpdesign.tracking.sources.time_table import TimeTable, read_time_table
from cmpdesign.tracking.sources.videos import VideoSource, is_video_part
from cmpdesign.tracking.sources.views import MultiViewSource


def open_source(
    source: str | Sequence[str],
    how: Reading = Reading(),  # noqa: B008
) -> FrameSource:
    """Open the source that one text or several texts name, see ``name_sources``: consecutive pictures, the parts of a
    split recording, or one other source.

    Args:
        source: the texts.
        how: how the source is read.

    Raises:
        SourceError: a source cannot be opened, or several are neither pictures nor videos.
    """
    named = name_sources([source] if isinstance(source, str) else source)
    if not named:
        raise SourceError("no source is given")
    if len(named) == 1:
        return open_named(named[0], how)
    paths = [path for each in named for path in each.paths if each.kind is SourceKind.FILE]
    if len(paths) == len(named) and all(map(is_video_part, paths)):
        return VideoSource(paths, how.fps, how.max_pixels, _wanted_times(how.times))
    first = next(each for each in named if each.kind is not SourceKind.IMAGES)
    raise SourceError(
        f"{first.name}: cannot be one of {len(named)} sources; give pictures only, the videos of one recording, or one "
        "camera or stream"
    )


def open_named(source: NamedSource, how: Reading = Reading()) -> FrameSource:  # noqa: B008
    """Open a source that ``name_sources`` found; see ``open_source``.

    Raises:
        SourceError: the source cannot be opened.
    """
    wanted = _wanted_times(how.times)
    if how.camera.asked and source.kind is not SourceKind.CAMERA:
        name = next(iter(how.camera.asked))
        raise SourceError(f"{source.name} is no camera: {parameter(name)} is for cameras; leave it out")
    if source.address and wanted is not None:
        raise SourceError(
            f"{source.name}: {parameter('times')} is for files; a camera and a stream have their own times"
        )
    match source.kind:
        case SourceKind.STREAM:
            return StreamSource(source.address, how.max_pixels)
        case SourceKind.CAMERA:
            return open_camera(int(source.address), source.name, how.max_pixels, how.camera)
        case SourceKind.FILE if not is_image_file(source.paths[0]):
            return VideoSource(source.paths, how.fps, how.max_pixels, wanted)
    return ImagesSource(source.paths, source.name, how, wanted, source.left_out)


def open_sources(text: str, how: Reading = Reading()) -> FrameSource:  # noqa: B008
    """Open a source, or for a list with commas one source for each view; see ``open_source``.

    Raises:
        SourceError: a source cannot be opened.
    """
    names = split_list(text)
    if len(names) == 1:
        return open_source(text, how)
    return MultiViewSource([open_source(name, how) for name in names])


def split_list(text: str) -> list[str]:
    """Split a list with commas; a text that is the path of a file is one name."""
    return [text] if path_exists(text) else text.split(",")


def _wanted_times(text: str | None) -> str | TimeTable | None:
    if text is None or text in ("names", "index"):
        return text
    if Path(text).suffix.lower() != ".csv":
        raise SourceError(
            f"{parameter('times', text)}: expected names, index or a file .csv of FRAME,SECONDS"
        )
    return read_time_table(Path(text))
