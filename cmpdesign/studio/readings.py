"""The pictures and layouts that were dropped on the page: read, judged, and kept for their stages and tables."""

from __future__ import annotations

import secrets
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from cmpdesign.api.verifying import Verifier
from cmpdesign.errors import CmpDesignError
from cmpdesign.files.atomic import write_file
from cmpdesign.files.images import IMAGE_BITS, ImageFileError, read_image, to_jpeg
from cmpdesign.inputs.documents import parse_json
from cmpdesign.inputs.files import read_file
from cmpdesign.studio.pictures import residual_picture
from cmpdesign.studio.reading import MAX_PIXELS, StudioReading
from cmpdesign.studio.recording import KINDS
from extractor import Reference
from extractor.layout.layout_file import parse_layout

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.api.designs import Design
    from cmpdesign.products.laser.coupon.design import Coupon

MAX_PICTURE_BYTES = 64 << 20
MAX_KEPT = 40  # pictures, as files
MAX_LAYOUTS = 8
JPEG_QUALITY = 92
_PICTURE = "picture"


class Readings:
    """The last pictures and layouts of this run of the page."""

    def __init__(self) -> None:
        self._readings: dict[str, StudioReading] = {}
        self._verifier: Verifier | None = None
        self._layouts: dict[str, Reference | Coupon] = {}
        self._stages: tuple[str, Mapping[str, NDArray[np.uint8]]] = ("", {})  # of one picture, by its key
        self._drawing = Lock()

    def add_layout(self, text: str) -> dict[str, Any]:
        """Keep a layout file, or a coupon.json or grid.json, to read pictures with.

        Raises:
            CmpDesignError, LayoutError: the text is neither.
        """
        from cmpdesign.products.laser.coupon.design import parse_coupon

        document = parse_json(text, "the layout")
        key = secrets.token_hex(8)
        if isinstance(document, dict) and document.get("format") == "cmp-coupon":
            coupon = parse_coupon(document, "the coupon")
            self._layouts[key], about = coupon, f"{coupon.kind} coupon, {coupon.material}"
        else:
            layout = parse_layout(text)
            self._layouts[key] = layout
            about = f"{layout.pattern}, {int(layout.present.sum())} markers"
        for old in list(self._layouts)[:-MAX_LAYOUTS]:
            del self._layouts[old]
        return {"key": key, "about": about}

    def layout(self, design: Design, key: str) -> Reference:
        """The layout of a key; of the design where the key is empty, or names a coupon.

        Raises:
            CmpDesignError: no such layout.
        """
        if key and key not in self._layouts:
            raise CmpDesignError("this layout is gone; open it again")
        kept = self._layouts.get(key)
        return kept if isinstance(kept, Reference) else design.layout.reference()

    def read(self, design: Design, layout: str, name: str, data: bytes) -> dict[str, Any]:
        """Read a picture: of a pattern, of a print sheet, or of a coupon of the design's laser job.

        The document of a picture of a pattern also has the names of the stages that were reached.

        Args:
            design: the open design.
            layout: key of a layout or a coupon; "": that of the design.
            name: the picture's name.
            data: bytes of the file.

        Raises:
            ImageFileError: no color picture, or a picture of too many pixels.
        """
        reference = self.layout(design, layout)
        folder = Path(tempfile.mkdtemp(prefix="cmpdesign-studio-"))
        suffix = Path(name).suffix.lower()
        file = folder / f"{_PICTURE}{suffix if suffix in IMAGE_BITS else ''}"
        try:
            write_file(file, data)
            reading = self._judged(reference, partial(self._coupons, design, layout), name, file)
        except BaseException as error:
            shutil.rmtree(folder, ignore_errors=True)
            if isinstance(error, CmpDesignError):
                raise CmpDesignError(str(error).replace(str(file), name)) from None
            raise
        document = {**reading.document(), "stages": [*self._draw(reading)]}
        if reading.markers is not None:
            bare = replace(reading.markers, stages={})
            reading = replace(reading, verdict=replace(reading.verdict, markers=bare))
        self._readings[reading.key] = reading
        for old in list(self._readings.values())[:-MAX_KEPT]:
            self._forget(old)
        return document

    def picture(self, key: str, stage: str) -> bytes:
        """A picture, or one of its stages, as a JPEG.

        Raises:
            CmpDesignError: no such reading, or no such stage.
        """
        reading = self.get(key)
        if stage == _PICTURE:
            pixels: NDArray[Any] | None = read_image(reading.file, MAX_PIXELS, gray=True)
        else:
            with self._drawing:
                pixels = (self._stages[1] if self._stages[0] == key else self._draw(reading)).get(stage)
        if pixels is None:
            raise CmpDesignError(f"{stage[:40]}: this picture has no such stage")
        return to_jpeg(in_8_bits(pixels), JPEG_QUALITY)

    def get(self, key: str) -> StudioReading:
        """A reading by its key.

        Raises:
            CmpDesignError: no such reading.
        """
        if key not in self._readings:
            raise CmpDesignError("this picture is gone; drop it again")
        return self._readings[key]

    def track(self, keys: Sequence[str], rest: str | None, kind: str) -> bytes:
        """The table or recording that ``track`` writes of pictures in their order.

        Args:
            keys: the pictures.
            rest: the picture at rest; None: the first.
            kind: one of ``KINDS``.

        Raises:
            CmpDesignError: no picture, pictures of several layouts, or an unknown kind.
        """
        from cmpdesign.api.sequences import track

        read = [self.get(key) for key in keys[: MAX_KEPT + 1]]
        if kind not in KINDS:
            raise CmpDesignError(f"{kind[:20]}: expected one of {', '.join(KINDS)}")
        if not 0 < len(read) <= MAX_KEPT or len({one.verifier.reference.digest for one in read}) > 1:
            raise CmpDesignError(f"choose 1 to {MAX_KEPT} pictures that were read with one layout")
        with tempfile.TemporaryDirectory(prefix="cmpdesign-studio-") as folder:
            frames = Path(folder) / "frames"
            frames.mkdir()
            for number, one in enumerate(read):
                shutil.copyfile(one.file, frames / f"{number:04d}{one.file.suffix or '.png'}")
            made = Path(folder) / f"run.{kind}"
            at_rest = None if rest is None else self.get(rest).file
            track(
                read[0].verifier.reference, frames, made, rest=at_rest, side="either", max_pixels=MAX_PIXELS
            )
            return read_file(made)

    def close(self) -> None:
        """Remove all pictures."""
        for reading in list(self._readings.values()):
            self._forget(reading)

    def _coupons(self, design: Design, layout: str) -> list[Coupon]:
        """The coupon of a key; else those of the design's laser job."""
        from cmpdesign.studio.coupons import coupons_of

        given = self._layouts.get(layout)
        return coupons_of(design) if given is None or isinstance(given, Reference) else [given]

    def _judged(
        self, reference: Reference, coupons: Callable[[], list[Coupon]], name: str, file: Path
    ) -> StudioReading:
        """The reading of a file; a picture without a marker may show a coupon."""
        if self._verifier is None or self._verifier.reference.digest != reference.digest:
            self._verifier = Verifier(reference, max_pixels=MAX_PIXELS)
        verifier, problem, verdict, size_px = self._verifier, None, None, (0, 0)
        try:
            image = verifier.read(file)
            size_px, verdict = (image.shape[1], image.shape[0]), verifier.judge(image, file)
        except ImageFileError as error:  # a scan of a coupon may be gray
            problem = error
        key = secrets.token_hex(8)
        markers = getattr(verdict, "markers", None)
        from cmpdesign.studio.coupons import coupon_readings

        if verdict is None or (markers is not None and not markers.found):
            for coupon, found, shown_px in coupon_readings(coupons(), file, MAX_PIXELS):
                return StudioReading(key, name, file, verifier, shown_px, found, coupon)
        if problem is not None:
            raise problem
        return StudioReading(key, name, file, verifier, size_px, verdict)

    def _draw(self, reading: StudioReading) -> Mapping[str, NDArray[np.uint8]]:
        """Stage -> picture of its result; kept until another picture's are drawn."""
        from extractor.draw import draw_stages

        if reading.markers is None:
            return {}
        verifier, markers = reading.verifier, reading.markers
        image = verifier.read(reading.file)
        markers = markers if markers.stages else verifier.extractor.extract(image)
        stages = draw_stages(image, verifier.reference, markers)
        if markers.found and "refine" in markers.stages:
            stages["residual"] = residual_picture(in_8_bits(image), verifier.reference, markers)
        self._stages = (reading.key, stages)
        return stages

    def _forget(self, reading: StudioReading) -> None:
        self._readings.pop(reading.key, None)
        shutil.rmtree(reading.file.parent, ignore_errors=True)


def in_8_bits(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """A picture of 8 or 16 bits with 8 bits."""
    return pixels if pixels.dtype == np.uint8 else (pixels >> 8).astype(np.uint8)
