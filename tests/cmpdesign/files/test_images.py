"""Image files: a file that is no color picture gives one clear line; a color picture is read as BGR."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from cmpdesign.contact.objects.heightmap import HeightMap
from cmpdesign.errors import CmpDesignError
from cmpdesign.files.image_header import size_in_header
from cmpdesign.files.images import ImageFileError, read_image
from cmpdesign.files.resolution import resolution_dpi
from tests.support.command import run

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
        (folder, "it is a folder"),
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


# -- images that claim to be large


def png(width: int, height: int) -> bytes:
    """A PNG of one color that claims a size; its pixels are not all there."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    pixels = chunk(b"IDAT", zlib.compress(bytes(1 << 20)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + pixels + chunk(b"IEND", b"")


def claiming(kind: str, width: int, height: int) -> bytes:
    """A small image of a kind whose header is changed to claim another size."""
    if kind == "png":
        return png(width, height)
    data = bytearray(cv2.imencode(f".{kind}", COLOR)[1].tobytes())
    if kind == "bmp":
        data[18:26] = struct.pack("<ii", width, height)
    elif kind == "jpg":
        at = data.index(b"\xff\xc0")
        data[at + 5 : at + 9] = struct.pack(">HH", min(height, 65_000), min(width, 65_000))
    elif kind == "tiff":
        for tag, value in ((256, width), (257, height)):
            at = data.index(struct.pack("<HHI", tag, 3, 1)) if struct.pack("<HHI", tag, 3, 1) in data else -1
            at = at if at >= 0 else data.index(struct.pack("<HHI", tag, 4, 1))
            data[at : at + 12] = struct.pack("<HHII", tag, 4, 1, value)
    elif kind == "ppm":
        data = bytearray(f"P6 {width} {height} 255\n".encode() + bytes(1000))
    return bytes(data)


@pytest.mark.parametrize("kind", ["png", "jpg", "tiff", "bmp", "ppm"])
def test_a_claimed_size_takes_no_memory(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"large.{kind}"
    path.write_bytes(claiming(kind, 20_000, 20_000))
    assert size_in_header(path.read_bytes()) == (20_000, 20_000)
    tracemalloc.start()
    try:
        with pytest.raises(ImageFileError, match=r"is 20000 x 20000 px, 400 megapixels; the limit is 250"):
            read_image(path)
        with pytest.raises(CmpDesignError, match="the limit is 25"):
            HeightMap.read(path, 0.1, depth_mm=1.0)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("kind", "depth"),
    [(kind, np.uint8) for kind in ("png", "jpg", "tiff", "bmp", "webp", "ppm")]
    + [(kind, np.uint16) for kind in ("png", "tiff", "ppm")],
)
def test_headers_say_what_is_decoded(kind: str, depth: type, tmp_path: Path) -> None:
    path = write(tmp_path / f"a.{kind}", COLOR.astype(depth))
    assert size_in_header(path.read_bytes()) == (24, 20)
    assert read_image(path).shape == (20, 24, 3)


def test_the_limit_can_be_raised_and_lowered(tmp_path: Path, layout_file: Path) -> None:
    path = write(tmp_path / "a.png", COLOR)
    assert read_image(path, most_pixels=480).shape == (20, 24, 3)
    with pytest.raises(ImageFileError, match="or raise max_pixels"):
        read_image(path, most_pixels=479)
    for arguments in (
        ("verify", layout_file, path),
        ("track", layout_file, tmp_path, "-o", tmp_path / "a.csv"),
    ):
        result = run(*arguments, "--max-pixels", 479)
        assert result.exit_code > 0
    assert "megapixels" in run("verify", layout_file, path, "--max-pixels", 479).stderr
    assert "megapixels" in (tmp_path / "a.csv").read_text(encoding="utf-8")


def test_a_scan_beyond_pillows_own_limit_is_read_without_a_warning(tmp_path: Path) -> None:
    """90 megapixels: an A4 page at 960 dpi; warnings are errors here."""
    path = tmp_path / "scan.png"
    Image.new("RGB", (9_500, 9_500), (200, 30, 40)).save(path, compress_level=1)
    assert read_image(path).shape == (9_500, 9_500, 3)


@pytest.mark.parametrize("shape", ["(1000000, 1000000)", "(-1, 5)", "(4, 5, 6)", "(" * 3000, "(1e6,)", "()"])
def test_arrays_that_claim_another_size(shape: str, tmp_path: Path) -> None:
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    path = tmp_path / "heights.npy"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(160))
    with pytest.raises(CmpDesignError):
        HeightMap.read(path, 0.1)


@pytest.mark.parametrize("kind", ["png", "jpg", "tiff", "bmp", "webp", "ppm"])
def test_damaged_files_are_read_or_refused(kind: str, tmp_path: Path) -> None:
    """One byte of the first 60 at a time, and pieces cut out."""
    good = cv2.imencode(f".{kind}", COLOR)[1].tobytes()
    path = tmp_path / f"a.{kind}"
    for place in range(60):
        for data in (
            good[:place] + b"\xff" + good[place + 1 :],
            good[:place] + b"\0" + good[place + 1 :],
            good[:place] + good[place + 4 :],
        ):
            path.write_bytes(data)
            try:
                assert read_image(path, most_pixels=100_000).shape[2] == 3
            except ImageFileError as error:
                assert str(error).startswith(str(path))
            resolution_dpi(path)


def test_a_png_of_few_bytes_claims_few_pixels(tmp_path: Path) -> None:
    """A size within the limit, but too large for the bytes of the file, is refused; the largest ratio of deflate is
    read.
    """
    (tmp_path / "claims.png").write_bytes(png(15_000, 15_000))
    with pytest.raises(ImageFileError, match="claims 15000 x 15000 px"):
        read_image(tmp_path / "claims.png")
    Image.new("1", (4_000, 4_000)).convert("P").save(tmp_path / "dense.png", bits=1, compress_level=9)
    assert read_image(tmp_path / "dense.png").shape == (4_000, 4_000, 3)
