"""Pictures that were dropped on the page: read, judged, and kept for their stages and the report of a problem."""

from __future__ import annotations

import secrets
import shutil
import tempfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cmpdesign.api.pictures import Verifier, verify
from cmpdesign.errors import CmpDesignError
from cmpdesign.files.atomic import write_file
from cmpdesign.files.images import IMAGE_BITS, to_jpeg
from cmpdesign.inputs.files import read_file

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from extractor import Markers, Reference

MOST_PICTURE_BYTES = 64 << 20
MOST_PIXELS = 60_000_000  # width x height, tested before a picture is decoded
MOST_KEPT = 4
JPEG_QUALITY = 92
_PICTURE = "picture"


@dataclass(frozen=True, eq=False)
class StudioReading:
    """One picture and its verdict.

    Attributes:
        key: name of the reading for the page.
        name: the picture's own name.
        file: the picture's bytes, in a private folder.
        verifier: the reader and its layout.
        image: (H, W, 3) BGR.
        verdict: ``Verdict`` of a pattern, or ``SheetVerdict`` of a print sheet.
    """

    key: str
    name: str
    file: Path
    verifier: Verifier
    image: NDArray[Any]
    verdict: Any

    def document(self) -> dict[str, Any]:
        """The verdict as in ``verify.json``, and the markers for the overlay."""
        from cmpdesign.reading.verify import Verdict

        height, width = self.image.shape[:2]
        found = {"key": self.key, "name": self.name, "size_px": [width, height], **self.verdict.to_json()}
        if not isinstance(self.verdict, Verdict):
            return {**found, "line": self.verdict.line()}
        markers, reference = self.verdict.markers, self.verifier.reference
        return {
            **found,
            **markers_document(markers, reference),
            "advice": markers.advice,
            "stages": list(self.stages),
        }

    @cached_property
    def stages(self) -> dict[str, NDArray[np.uint8]]:
        """Stage -> picture of its result."""
        from cmpdesign.reading.verify import Verdict
        from extractor.draw import draw_stages

        if not isinstance(self.verdict, Verdict):
            return {}
        return draw_stages(self.image, self.verifier.reference, self.verdict.markers)

    def picture(self, stage: str) -> bytes:
        """The picture, or one of its stages, as a JPEG.

        Raises:
            CmpDesignError: no such stage.
        """
        if stage != _PICTURE and stage not in self.stages:
            raise CmpDesignError(f"{stage[:40]}: this picture has no such stage")
        pixels = self.image if stage == _PICTURE else self.stages[stage]
        return to_jpeg(in_8_bits(pixels), JPEG_QUALITY)

    def report(self) -> bytes:
        """The bundle of a problem, as of ``verify --report``."""
        path = self.file.with_name("report.zip")
        verify(self.verifier.reference, self.file, report=path, max_pixels=MOST_PIXELS)
        return read_file(path)


class Readings:
    """The last readings of this run of the page."""

    def __init__(self) -> None:
        self._readings: dict[str, StudioReading] = {}
        self._verifiers: dict[str, Verifier] = {}

    def read(self, reference: Reference, name: str, data: bytes) -> StudioReading:
        """Read a picture.

        Raises:
            ImageFileError: no color picture, or a picture of too many pixels.
        """
        folder = Path(tempfile.mkdtemp(prefix="cmpdesign-studio-"))
        suffix = Path(name).suffix.lower()
        file = folder / f"{_PICTURE}{suffix if suffix in IMAGE_BITS else ''}"
        try:
            write_file(file, data)
            verifier = self._verifier(reference)
            image = verifier.read(file)
            verdict = verifier.judge(image, file)
        except BaseException as error:
            shutil.rmtree(folder, ignore_errors=True)
            if isinstance(error, CmpDesignError):
                raise CmpDesignError(str(error).replace(str(file), name)) from None
            raise
        reading = StudioReading(secrets.token_hex(8), name, file, verifier, image, verdict)
        self._readings[reading.key] = reading
        for old in list(self._readings.values())[:-MOST_KEPT]:
            self._forget(old)
        return reading

    def get(self, key: str) -> StudioReading:
        """A reading by its key.

        Raises:
            CmpDesignError: no such reading.
        """
        if key not in self._readings:
            raise CmpDesignError("this picture is gone; drop it again")
        return self._readings[key]

    def close(self) -> None:
        """Remove all pictures."""
        for reading in list(self._readings.values()):
            self._forget(reading)

    def _forget(self, reading: StudioReading) -> None:
        self._readings.pop(reading.key, None)
        shutil.rmtree(reading.file.parent, ignore_errors=True)

    def _verifier(self, reference: Reference) -> Verifier:
        """The reader of a layout; a reader is kept for the next picture of the same layout."""
        if reference.digest not in self._verifiers:
            self._verifiers = {reference.digest: Verifier(reference, max_pixels=MOST_PIXELS)}
        return self._verifiers[reference.digest]


def markers_document(markers: Markers, reference: Reference) -> dict[str, Any]:
    """The found markers: id, place and deviation in px, status, and the gridlines between found markers."""
    found = np.flatnonzero(np.isfinite(markers.xy_px[:, 0]))
    row = np.full(len(markers.xy_px), -1)
    row[found] = np.arange(len(found))
    edges = row[reference.edges]
    cov = markers.cov_px2[found]
    return {
        "ids": found.tolist(),
        "xy": markers.xy_px[found].round(3).tolist(),
        "cov": np.nan_to_num(cov)[:, [0, 0, 1], [0, 1, 1]].tolist(),
        "status": markers.status[found].tolist(),
        "edges": edges[(edges >= 0).all(axis=1)].tolist(),
        "layer": reference.layer[found].tolist(),
        "index": reference.index[found].tolist(),
    }


def in_8_bits(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """A picture of 8 or 16 bits with 8 bits."""
    return pixels if pixels.dtype == np.uint8 else (pixels >> 8).astype(np.uint8)
