"""The response that image files state: profiles by LittleCMS, PNG's chunks, and files that state none."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageCms, PngImagePlugin

from cmpdesign.products.laser.coupon.stated_response import profile_response, stated_response

PIXELS = Image.new("RGB", (20, 20), (90, 120, 150))


def profile(kind: bytes, body: bytes) -> bytes:
    """A profile with one tone curve."""
    curve = kind + bytes(4) + body
    return bytes(128) + struct.pack(">I", 1) + b"kTRC" + struct.pack(">II", 144, len(curve)) + curve


def test_littlecms_writes_srgb(tmp_path: Path) -> None:
    data = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    assert profile_response(data) == "srgb"
    for name in ("a.jpg", "a.png", "a.tif"):
        PIXELS.save(tmp_path / name, icc_profile=data)
        assert stated_response(tmp_path / name) == "srgb"


@pytest.mark.parametrize(
    ("data", "exponent"),
    [
        (profile(b"curv", struct.pack(">I", 0)), 1.0),
        (profile(b"curv", struct.pack(">IH", 1, 0x0180)), 1.5),
        (
            profile(
                b"curv",
                struct.pack(">I1024H", 1024, *np.rint(65535 * np.linspace(0, 1, 1024) ** 2).astype(int)),
            ),
            2.0,
        ),
        (profile(b"para", struct.pack(">HHi", 0, 0, round(1.8 * 65536))), 1.8),
        (
            profile(b"para", struct.pack(">HH5i", 3, 0, *(round(65536 * x) for x in (2.4, 1, 0, 1 / 4, 0)))),
            2.4,
        ),
    ],
)
def test_tone_curves_are_read(data: bytes, exponent: float) -> None:
    found: Any = profile_response(data)
    value = np.linspace(0, 1, 256)[80:]
    np.testing.assert_allclose(found[80:], value**exponent, atol=2e-4)
    assert (np.diff(found) > 0).all()


def test_png_states_srgb_or_a_gamma(tmp_path: Path) -> None:
    chunks = PngImagePlugin.PngInfo()
    chunks.add(b"gAMA", struct.pack(">I", 50_000))
    PIXELS.save(tmp_path / "gamma.png", pnginfo=chunks)
    assert stated_response(tmp_path / "gamma.png") == pytest.approx(2.0)
    chunks = PngImagePlugin.PngInfo()
    chunks.add(b"sRGB", b"\0")
    PIXELS.save(tmp_path / "srgb.png", pnginfo=chunks)
    assert stated_response(tmp_path / "srgb.png") == "srgb"


@pytest.mark.parametrize("data", [b"", bytes(40), profile(b"mft2", bytes(30)), profile(b"curv", b"")])
def test_other_profiles_state_nothing(data: bytes) -> None:
    assert profile_response(data) is None


def test_files_without_a_statement(tmp_path: Path) -> None:
    PIXELS.save(tmp_path / "plain.png")
    (tmp_path / "text.png").write_text("no image")
    for name in ("plain.png", "text.png", "none.png"):
        assert stated_response(tmp_path / name) is None
