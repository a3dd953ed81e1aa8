"""Errors of markers by the compression of video: compressed frames, compared with the same frames as PNG.

60 frames of 640 x 480 px at 30 frames per second (quick: 6): 331 markers, pressed, twisted, sheared and moved; blur
1 px, noise 2/255. Each codec writes them to a file, which is decoded and read with the preset "balanced". "moved" is
the RMS difference per axis between a marker's places in the decoded frame and in the PNG, px; "worst" its largest
value; "error" is the RMS error per axis against the scene's truth, px, and "of PNG" the same over that of the PNG
frames; z is the RMS error over the stated deviations. "kB" is the file's size over its frames, "ms" the time to encode
one. 4:4:4 keeps the full resolution of color; all other lossy codecs here halve it.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

os.environ.setdefault("SVT_LOG", "1")  # errors only, of the AV1 encoder

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.pooled import rms_of
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import timed
from benchmarks.tracking import render_sequence
from cmpdesign.files.images import to_png
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import Rendered, standard_layout
from cmpdesign.tracking.export.video import Codec, CodecVideo, require_av
from extractor import Extractor, Markers, parse_layout

FRAMES, QUICK_FRAMES, FPS = 60, 6, 30.0
PNG = "PNG"
CODECS: Mapping[str, tuple[str, Codec]] = {
    "FFV1": (".mkv", Codec("ffv1", "bgr0")),
    "H.264 lossless, RGB": (".mp4", Codec("libx264rgb", "bgr24", {"crf": "0"})),
    "H.264 crf 18": (".mp4", Codec("libx264", "yuv420p", {"crf": "18"})),
    "H.264 crf 23": (".mp4", Codec("libx264", "yuv420p", {"crf": "23"})),
    "H.264 crf 12, 4:4:4": (".mp4", Codec("libx264", "yuv444p", {"crf": "12"})),
    "H.264 crf 18, 4:4:4": (".mp4", Codec("libx264", "yuv444p", {"crf": "18"})),
    "AV1 crf 18": (".mp4", Codec("libsvtav1", "yuv420p", {"crf": "18", "preset": "8"})),
    "AV1 crf 30": (".mp4", Codec("libsvtav1", "yuv420p", {"crf": "30", "g": "2", "preset": "12"})),
    "Motion JPEG q 2": (".avi", Codec("mjpeg", "yuvj420p", {"qmin": "2", "qmax": "2"})),
}


COLUMNS = {
    "codec": TEXT, "moved": ".4f", "worst": ".2f", "error": ".4f", "of PNG": ".2f", "z": ".2f", "lost": ".2%",
    "kB": ".0f", "ms": ".0f",
}  # fmt: skip


@dataclass(frozen=True)
class Coded:
    """Frames after compression by a codec, the file's size in kB and the time to encode in ms, both per frame."""

    images: list[NDArray[np.uint8]]
    kb: float
    ms: float


def encode_and_decode(images: Sequence[NDArray[np.uint8]], name: str, folder: Path) -> Coded:
    """Write frames with a codec, and read them back as (H, W, 3) BGR."""
    ending, codec = CODECS[name]
    path = folder / f"video{ending}"
    started = time.perf_counter()
    video = CodecVideo(path, codec, FPS)
    for image in images:
        video.add(image)
    video.close()
    ms = 1e3 * (time.perf_counter() - started) / len(images)
    with require_av().open(str(path)) as container:
        decoded = [frame.to_ndarray(format="bgr24") for frame in container.decode(video=0)]
    if len(decoded) != len(images):
        raise RuntimeError(f"{name}: {len(decoded)} of {len(images)} frames were decoded")
    return Coded(decoded, path.stat().st_size / 1e3 / len(images), ms)


def png_files(images: Sequence[NDArray[np.uint8]]) -> Coded:
    """The frames themselves, with the size of their PNG files."""
    sizes = timed(lambda: [len(to_png(image)) for image in images])
    return Coded(list(images), sum(sizes.result) / 1e3 / len(images), sizes.clock_ms / len(images))


def codec_row(
    name: str, coded: Coded, read: Sequence[Markers], png: Sequence[Markers], truth: Sequence[Rendered]
) -> tuple[object, ...]:
    """The row of ``COLUMNS`` from the markers of its frames, of the PNG frames, and the truth."""
    true_px = np.stack([one.truth.marker_xy_px for one in truth])
    xy_px, png_px = (np.stack([one.xy_px for one in markers]) for markers in (read, png))
    sigma_px = np.sqrt(np.stack([one.cov_px2[:, [0, 1], [0, 1]] for one in read]))
    error_px, moved_px = xy_px - true_px, xy_px - png_px
    return (
        name, rms_of(moved_px), float(np.nanmax(np.abs(moved_px))), rms_of(error_px),
        rms_of(error_px) / rms_of(png_px - true_px), rms_of(error_px / sigma_px),
        float(np.mean([one.status == 0 for one in read])), coded.kb, coded.ms,
    )  # fmt: skip


def measure(quick: bool = False) -> Shown:
    """One row for PNG, and one a codec.

    Args:
        quick: few frames.
    """
    layout, count = standard_layout(), QUICK_FRAMES if quick else FRAMES
    rendered = list(islice(render_sequence(layout, count, jerky=False), count))
    images = [one.image for one in rendered]
    extractor = Extractor(parse_layout(layout_to_json(layout)))
    png = [extractor.extract(image) for image in images]
    rows = [codec_row(PNG, png_files(images), png, png, rendered)]
    with tempfile.TemporaryDirectory() as folder:
        for name in CODECS:
            coded = encode_and_decode(images, name, Path(folder))
            read = [extractor.extract(image) for image in coded.images]
            rows.append(codec_row(name, coded, read, png, rendered))
    yield Table("codecs", COLUMNS, rows)


main = Experiment("codecs", measure)
main.run_as(__name__)
