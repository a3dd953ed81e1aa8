"""The images of a folder, in the natural order of their names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cmpdesign.files.images import ImageFileError
from cmpdesign.inputs.files import is_folder

IMAGE_SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp"}


def find_images(folder: Path) -> list[Path]:
    """The image files of a folder: frame2 before frame10.

    Raises:
        ImageFileError: the folder cannot be read, or holds no image.
    """
    try:
        paths = sorted(
            (path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES),
            key=_natural_sort_key,
        )
    except OSError as error:
        raise ImageFileError(f"{folder}: cannot be read ({error.strerror or error})") from None
    if not paths:
        raise ImageFileError(
            f"{folder}: holds no image; expected files ending in {', '.join(sorted(IMAGE_SUFFIXES))}"
        )
    return paths


def without_folders(paths: Sequence[Path]) -> list[Path]:
    """The paths, with every folder replaced by its images.

    Raises:
        ImageFileError: a folder cannot be read, or holds no image.
    """
    return [image for path in paths for image in (find_images(path) if is_folder(path) else [path])]


def _natural_sort_key(path: Path) -> list[tuple[int, int | str]]:
    """The key of the natural order: frame2 before frame10."""
    parts: list[tuple[int, int | str]] = []
    digits = ""
    for letter in path.name + "\0":
        if letter in "0123456789":
            digits += letter
            continue
        if digits:
            parts.append((0, int(digits)))
            digits = ""
        parts.append((1, letter))
    return parts
