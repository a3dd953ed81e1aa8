"""Image files: what is no color picture is one clear line; what is one comes as BGR."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from cmpdesign.files.images import ImageFileError, read_image

COLOR = np.arange(20 * 24 * 3, dtype=np.uint8).reshape(20, 24, 3)


def write(path: Path, pixels: np.ndarray) -> Path:
    assert cv2.imwrite(str(path), pixels)
    return path


def test_color(tmp_path: Path) -> None:
    np.testing.assert_array_equal(read_image(write(tmp_path / "a.png", COLOR)), COLOR)


def test_16_bit_keeps_its_depth(tmp_path: Path) -> None:
    deep = COLOR.astype(np.uint16) * 257
    for name in ("a.png", "a.tiff"):
        read = read_image(write(tmp_path / name, deep))
        np.testing.assert_array_equal(read, deep)
        assert read.dtype == np.uint16


def test_alpha_is_dropped(tmp_path: Path) -> None:
    with_alpha = np.dstack([COLOR, np.full(COLOR.shape[:2], 7, np.uint8)])
    read = read_image(write(tmp_path / "a.png", with_alpha))
    np.testing.assert_array_equal(read, COLOR)
    assert read.flags.c_contiguous


def test_odd_names(tmp_path: Path) -> None:
    path = tmp_path / "Aufnahme 1 – größer.png"
    write(tmp_path / "a.png", COLOR).rename(path)
    assert read_image(path).shape == (20, 24, 3)


def text(path: Path) -> None:
    path.write_text("not a picture")


def empty(path: Path) -> None:
    path.touch()


def folder(path: Path) -> None:
    path.mkdir()


def tiny(path: Path) -> None:
    write(path, COLOR[:1, :1])


def narrow(path: Path) -> None:
    write(path, COLOR[:, :15])


def grayscale(path: Path) -> None:
    write(path, COLOR[..., 0])


def float_tiff(path: Path) -> None:
    write(path.with_suffix(".tiff"), COLOR.astype(np.float32)).rename(path)


def cut(path: Path) -> None:
    path.write_bytes(write(path, COLOR).read_bytes()[:40])


def missing(path: Path) -> None:
    pass


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (missing, "No such file"),
        (text, "is not an image"),
        (empty, "is empty"),
        (folder, "Is a directory"),
        (cut, "is not an image"),
        (tiny, "is 1 x 1 px; expected at least 16 x 16 px"),
        (narrow, "is 15 x 20 px"),
        (grayscale, "a multicolor pattern needs color"),
        (float_tiff, "type float32; expected 8 or 16 bits"),
    ],
)
def test_bad_files(tmp_path: Path, make: Callable[[Path], None], expected: str) -> None:
    path = tmp_path / "image.png"
    make(path)
    with pytest.raises(ImageFileError, match=expected) as caught:
        read_image(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
