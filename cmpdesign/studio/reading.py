"""One picture that was dropped on the page: its document, its displacements from another one, and its report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cmpdesign.api.verifying import Verifier, verify
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.files import read_file
from extractor import Reference

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.products.laser.coupon.design import Coupon
    from extractor import Markers

MAX_PIXELS = 60_000_000  # width x height, tested before a picture is decoded


@dataclass(frozen=True, eq=False)
class StudioReading:
    """One picture and its verdict; pixels and stages are not kept, but read again where they are needed.

    Attributes:
        key: name of the reading for the page.
        name: the picture's own name.
        file: the picture's bytes, in a private folder.
        verifier: the reader and its layout.
        size_px: width and height.
        verdict: ``Verdict`` of a pattern, ``SheetVerdict`` of a print sheet, ``CouponReading`` or ``GridReading``.
        coupon: the coupon that the picture shows, if any.
    """

    key: str
    name: str
    file: Path
    verifier: Verifier
    size_px: tuple[int, int]
    verdict: Any
    coupon: Coupon | None = None

    @property
    def markers(self) -> Markers | None:
        """The markers of a picture of a pattern."""
        return getattr(self.verdict, "markers", None)

    def document(self) -> dict[str, Any]:
        """The verdict as in the document of ``verify`` or ``kerf``, and the markers for the overlay."""
        about = {"key": self.key, "name": self.name, "size_px": self.size_px}
        if self.coupon is not None:
            if self.coupon.kind == "grid":
                return {**about, "grid": self.verdict.to_json(), "material": self.coupon.material}
            return {**about, "kerf": self.verdict.to_json(self.coupon), "material": self.coupon.material}
        found = {**about, **self.verdict.to_json()}
        if self.markers is None:
            return {**found, "line": self.verdict.line()}
        markers = markers_document(self.markers, self.verifier.reference)
        return {**found, **markers, "advice": self.markers.advice}

    def moved(self, rest: StudioReading | None) -> dict[str, Any]:
        """Displacements from another picture, or without one from the flat pattern that fits best.

        Rows are those of ``document``; null where a displacement is unknown. ``sigma_px`` is its larger deviation by
        both pictures' covariances.

        Raises:
            CmpDesignError: the pictures cannot be compared.
        """
        from extractor.numeric.homographies import mapped
        from extractor.track.displacement import fit_rest

        reference = self.verifier.reference
        if self.markers is None or (rest is not None and rest.markers is None):
            raise CmpDesignError(
                "only pictures of patterns have displacements; choose another picture as rest"
            )
        cov = self.markers.cov_px2
        if rest is None:
            plane = fit_rest(self.markers.xy_px, reference).layout_from_image
            if plane is None:
                raise CmpDesignError("fewer than 4 markers are found: no flat pattern can be fitted")
            base_px = mapped(np.linalg.inv(plane).astype(np.float64), reference.xy_mm)
        else:
            assert rest.markers is not None
            if rest.verifier.reference.digest != reference.digest or rest.size_px != self.size_px:
                raise CmpDesignError(
                    f"{rest.name} and {self.name} differ in layout or size; read both with one layout and camera"
                )
            base_px, cov = rest.markers.xy_px, cov + rest.markers.cov_px2
        found = found_markers(self.markers)
        px = (self.markers.xy_px - base_px)[found]
        mm = fit_rest(base_px, reference).displacement_mm(self.markers.xy_px)[found]
        sigma_px = np.sqrt(np.linalg.eigvalsh(np.nan_to_num(cov[found]))[:, 1])
        known = np.isfinite(mm).all(axis=1)
        length_mm = np.linalg.norm(mm[known], axis=1)
        return {
            "from": None if rest is None else rest.name,
            "px": _rows(px, 3),
            "mm": _rows(mm, 5),
            "sigma_px": sigma_px.round(4).tolist(),
            "largest_mm": round(float(length_mm.max()), 5) if known.any() else None,
            "rms_mm": round(float(np.sqrt(np.mean(length_mm**2))), 5) if known.any() else None,
        }

    def report(self) -> bytes:
        """The bundle of a problem, as of ``verify --report``."""
        path = self.file.with_name("report.zip")
        verify(self.verifier.reference, self.file, report=path, max_pixels=MAX_PIXELS)
        return read_file(path)


def found_markers(markers: Markers) -> NDArray[np.intp]:
    """The ids of the markers that have a place."""
    return np.flatnonzero(np.isfinite(markers.xy_px[:, 0]))


def markers_document(markers: Markers, reference: Reference) -> dict[str, Any]:
    """The found markers: id, place and deviation in px, status, and the gridlines between found markers."""
    found = found_markers(markers)
    row = np.full(len(markers.xy_px), -1)
    row[found] = np.arange(len(found))
    edges = row[reference.edges]
    refined = markers.stages.get("refine")
    return {
        "ids": found.tolist(),
        "xy": markers.xy_px[found].round(3).tolist(),
        "xy_mm": reference.xy_mm[found].round(5).tolist(),
        "cov": np.nan_to_num(markers.cov_px2[found])[:, [0, 0, 1], [0, 1, 1]].tolist(),
        "status": markers.status[found].tolist(),
        "explained": None if refined is None else refined.explained[found].tolist(),
        "edges": edges[(edges >= 0).all(axis=1)].tolist(),
        "layer": reference.layer[found].tolist(),
        "index": reference.index[found].tolist(),
    }


def _rows(values: NDArray[Any], digits: int) -> list[list[float] | None]:
    """Rows for JSON; None for a row with a NaN."""
    known = np.isfinite(values).all(axis=1).tolist()
    return [
        row if is_known else None for row, is_known in zip(values.round(digits).tolist(), known, strict=True)
    ]
