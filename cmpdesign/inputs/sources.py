"""Sources of images by their texts: pictures, folders, patterns of names, videos, cameras, streams.

``verify``, ``track``, ``reconstruct`` and ``calibrate`` take the same texts.
"""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

from cmpdesign.errors import InputError, SourceError
from cmpdesign.inputs.cameras import camera_of_path, find_camera
from cmpdesign.inputs.files import is_folder, is_regular_file, open_file, path_exists
from cmpdesign.inputs.frame_names import in_order_of_names

IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp"})
_TAIL_BYTES = 4096
_ADDRESS = re.compile(r"(rtsp|rtsps|rtmp|http|https|udp|tcp)://", re.IGNORECASE)


class SourceKind(Enum):
    """The kind of a source of images."""

    IMAGES = "images"  # files, in order
    FILE = "file"  # a video, or an image of another ending
    CAMERA = "camera"
    STREAM = "stream"


@dataclass(frozen=True)
class NamedSource:
    """The source that one text, or several texts of pictures one after another, name.

    Attributes:
        kind: kind of the source.
        name: the texts, for messages; without the password of an address.
        paths: the files of ``IMAGES`` and of ``FILE``; within a folder or pattern in the order of their names'
            numbers, see ``frame_names``.
        address: number of a camera, or address of a stream.
        left_out: number of files of a folder or pattern that are hidden, empty or cut off.
    """

    kind: SourceKind
    name: str
    paths: tuple[Path, ...] = ()
    address: str = ""
    left_out: int = 0


def name_sources(texts: Iterable[str]) -> list[NamedSource]:
    """The sources that the texts name, in their order; consecutive pictures are one source.

    Args:
        texts: each a picture, a folder of pictures, a pattern such as "run*/*.png" ("**" for any folders), a video,
            a camera by its number, its file, its serial number or a part of its name, or the address of a stream. A
            path that exists is no pattern, no number and no name.

    Raises:
        SourceError: a folder cannot be read or holds no image, no file matches a pattern, or several cameras do.
    """
    found: list[NamedSource] = []
    for text in texts:
        for source in _named_by(text):
            if source.kind is SourceKind.IMAGES and found and found[-1].kind is SourceKind.IMAGES:
                name = f"{found[-1].name}, {source.name}" if source.name != found[-1].name else source.name
                paths, left_out = found[-1].paths + source.paths, found[-1].left_out + source.left_out
                source = NamedSource(SourceKind.IMAGES, name, paths, left_out=left_out)
                found.pop()
            found.append(source)
    return found


def picture_paths(texts: Iterable[str]) -> list[Path]:
    """The files of pictures that the texts name, see ``name_sources``.

    Raises:
        SourceError: a text names a camera or a stream.
    """
    found = name_sources(texts)
    for source in found:
        if source.address:
            raise SourceError(
                f"{source.name}: expected pictures, folders of pictures or patterns of their names"
            )
    return [path for source in found for path in source.paths]


def without_password(text: str) -> str:
    """A source's text for messages: the address of a stream without user and password."""
    return re.sub(r"^([a-z]+://)[^/@]*@", r"\1", text, flags=re.IGNORECASE)


def is_stream_address(text: str) -> bool:
    """True for a text such as "rtsp://host/path"."""
    return _ADDRESS.match(text) is not None


def find_images(folder: Path) -> NamedSource:
    """The image files of a folder, without hidden, empty and half-copied files.

    Raises:
        SourceError: the folder cannot be read, or holds no image.
    """
    try:
        found = [path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES]
    except OSError as error:
        raise SourceError(f"{folder}: cannot be read ({error.strerror or error})") from None
    source = _in_order(found, str(folder))
    if not source.paths:
        others = f" ({source.left_out} hidden, empty or cut off)" if source.left_out else ""
        raise SourceError(
            f"{folder}: holds no image{others}; expected files ending in {', '.join(sorted(IMAGE_SUFFIXES))}"
        )
    return source


def is_whole(path: Path) -> bool:
    """False for an image file that is empty or cut off: a PNG or JPEG without its end."""
    if not is_regular_file(path):
        return True  # its reader says what it is
    try:
        with open_file(path) as file:
            head = file.read(8)
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - _TAIL_BYTES))
            tail = file.read(_TAIL_BYTES)
            if head.startswith(b"\x89PNG"):
                return b"IEND" in tail
            if head.startswith(b"\xff\xd8") and b"\xff\xd9" not in tail:
                file.seek(0)
                return has_jpeg_end(file.read())
    except (InputError, OSError):
        return True
    return size > 0


def has_jpeg_end(data: bytes) -> bool:
    """True if a JPEG has its end after the beginning of its pixels, whatever follows it."""
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:  # until the start of scan
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return data.find(b"\xff\xd9", at) >= 0


def _in_order(found: Iterable[Path], name: str) -> NamedSource:
    """The pictures of one folder or pattern."""
    files = sorted(found, key=_natural_sort_key)
    whole = [path for path in files if not path.name.startswith(".") and is_whole(path)]
    return NamedSource(
        SourceKind.IMAGES, name, tuple(in_order_of_names(whole)), left_out=len(files) - len(whole)
    )


def _named_by(text: str) -> Sequence[NamedSource]:
    if is_stream_address(text):
        return [NamedSource(SourceKind.STREAM, without_password(text), address=text)]
    if path_exists(text):
        number = camera_of_path(text)
        return [_camera(text, number)] if number is not None else [_named_path(Path(text), text)]
    if text.isdecimal():
        return [_camera(text, int(text))]
    if glob.has_magic(text):
        return _matching(text)
    if "/" not in text and (camera := find_camera(text)) is not None:
        return [_camera(camera.name, camera.number)]
    return [_named_path(Path(text), text)]


def _camera(name: str, number: int) -> NamedSource:
    return NamedSource(SourceKind.CAMERA, f"camera {name}", address=str(number))


def _named_path(path: Path, name: str) -> NamedSource:
    """The source of a file. The file is not opened here; a missing file is found when the file is read."""
    if is_folder(path):
        return replace(find_images(path), name=name)
    kind = SourceKind.IMAGES if path.suffix.lower() in IMAGE_SUFFIXES else SourceKind.FILE
    return NamedSource(kind, name, (path,))


def _matching(pattern: str) -> list[NamedSource]:
    """The files and folders that match a pattern, each as if named alone."""
    try:
        # Path.glob takes no pattern that begins at the root.
        names = glob.glob(pattern, recursive=True)  # noqa: PTH207
    except (OSError, ValueError, re.error) as error:
        raise SourceError(f"{pattern} is no pattern of file names ({error})") from None
    found = sorted(map(Path, names), key=_natural_sort_key)
    # "**" also matches the folders above the files, which are not named alone then.
    files = [path for path in found if not is_folder(path)]
    if not found:
        raise SourceError(f"{pattern}: no file matches this pattern")
    pictures = [path for path in files if path.suffix.lower() in IMAGE_SUFFIXES]
    if pictures and len(pictures) == len(files):
        source = _in_order(pictures, pattern)
        return [source] if source.paths else [replace(source, paths=tuple(pictures), left_out=0)]
    return [_named_path(path, pattern) for path in (files or found)]


def _natural_sort_key(path: Path) -> list[tuple[int, int | str]]:
    """The key of the natural order: frame2 before frame10; the files of a folder follow each other."""
    key: list[tuple[int, int | str]] = []
    digits = ""
    for letter in f"{path.parent}\0{path.name}\0":
        if letter in "0123456789":
            digits += letter
            continue
        if digits:
            key.append((0, int(digits)))
            digits = ""
        key.append((1, letter))
    return key
