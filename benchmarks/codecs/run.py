"""Errors of markers by the compression of video: compressed frames, compared with the same frames as PNG.

    python -m benchmarks.codecs [--quick] [--json FILE]

60 frames of 640 x 480 px at 30 frames per second (quick: 6): 331 markers, pressed, twisted, sheared and moved; blur
1 px, noise 2/255. Each codec writes them to a file, which is decoded and read with the preset "balanced". "moved" is
the RMS difference per axis between a marker's places in the decoded frame and in the PNG, px; "worst" its largest
value; "error" is the RMS error per axis against the scene's truth, px, and "of PNG" the same over that of the PNG
frames; z is the RMS error over the stated deviations. "kB" is the file's size over its frames, "ms" the time to encode
one. 4:4:4 keeps the full resolution of color; all other lossy codecs here halve it.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path

os.environ.setdefault("SVT_LOG", "1")  # errors only, of the AV1 encoder

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from benchmarks.support.machine import conditions_text, write_json
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


@dataclass(frozen=True)
class CodecResult:
    """The errors of a codec for the markers of a sequence; lengths in px per axis, RMS unless named otherwise."""

    codec: str
    moved_px: float
    worst_px: float
    error_px: float
    of_png: float
    z: float
    lost_share: float
    kb_a_frame: float
    ms_a_frame: float


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
    started = time.perf_counter()
    sizes = [len(to_png(image)) for image in images]
    ms = 1e3 * (time.perf_counter() - started) / len(images)
    return Coded(list(images), sum(sizes) / 1e3 / len(images), ms)


def rms(values: NDArray[np.float64]) -> float:
    """Root mean square of the known values."""
    return float(np.sqrt(np.nanmean(values**2)))


def compare(
    name: str, coded: Coded, read: Sequence[Markers], png: Sequence[Markers], truth: Sequence[Rendered]
) -> CodecResult:
    """The figures of a codec from the markers of its frames, of the PNG frames, and the truth."""
    true_px = np.stack([one.truth.marker_xy_px for one in truth])
    xy_px, png_px = (np.stack([one.xy_px for one in markers]) for markers in (read, png))
    sigma_px = np.sqrt(np.stack([one.cov_px2[:, [0, 1], [0, 1]] for one in read]))
    error_px = rms(xy_px - true_px)
    return CodecResult(
        codec=name,
        moved_px=rms(xy_px - png_px),
        worst_px=float(np.nanmax(np.abs(xy_px - png_px))),
        error_px=error_px,
        of_png=error_px / rms(png_px - true_px),
        z=rms((xy_px - true_px) / sigma_px),
        lost_share=float(np.mean([one.status == 0 for one in read])),
        kb_a_frame=coded.kb,
        ms_a_frame=coded.ms,
    )


def measure(count: int) -> list[CodecResult]:
    """One result for PNG, and one a codec."""
    layout = standard_layout()
    rendered = list(islice(render_sequence(layout, count, jerky=False), count))
    images = [one.image for one in rendered]
    extractor = Extractor(parse_layout(layout_to_json(layout)))
    png = [extractor.extract(image) for image in images]
    results = [compare(PNG, png_files(images), png, png, rendered)]
    with tempfile.TemporaryDirectory() as folder:
        for name in CODECS:
            coded = encode_and_decode(images, name, Path(folder))
            read = [extractor.extract(image) for image in coded.images]
            results.append(compare(name, coded, read, png, rendered))
    return results


def result_table(results: Sequence[CodecResult]) -> Table:
    """The table."""
    table = Table(title="Video codecs", box=SIMPLE_HEAD, title_justify="left", pad_edge=False)
    table.add_column("codec", no_wrap=True)
    for name in ("moved", "worst", "error", "of PNG", "z", "kB", "ms"):
        table.add_column(name, justify="right", no_wrap=True)
    for one in results:
        table.add_row(
            one.codec,
            f"{one.moved_px:.4f}",
            f"{one.worst_px:.2f}",
            f"{one.error_px:.4f}",
            f"{one.of_png:.2f}",
            f"{one.z:.2f}",
            f"{one.kb_a_frame:.0f}",
            f"{one.ms_a_frame:.0f}",
        )
    return table


def main(arguments: list[str] | None = None) -> int:
    """Measure, print the table, write the JSON file if asked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.codecs", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--quick", action="store_true", help="few frames: a look, no figures to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every figure, too")
    options = parser.parse_args(arguments)
    results = measure(QUICK_FRAMES if options.quick else FRAMES)
    console = Console()
    console.print(result_table(results))
    console.print(conditions_text(), style="dim", soft_wrap=True)
    if options.json:
        write_json(options.json, {"codecs": [asdict(one) for one in results]})
    return 0


if __name__ == "__main__":
    sys.exit(main())
