"""Green's matrix of a pad: displacement of its markers by loads on the touched face, and its file.

``cmpdesign calibrate gel`` makes the file once for a pad and its elastomer; numpy reads it.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
import zlib
from dataclasses import dataclass, field, fields
from os import PathLike
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from extractor.errors import GelError
from extractor.layout.reference import Reference
from extractor.layout.text_file import printable_path, read_bytes_file

Array = NDArray[np.float64]
FORMAT = "cmp-gel 1"
HOW = "make the file with: cmpdesign calibrate gel LAYOUT RIG -o FILE"
MAX_BYTES = 1 << 29
_DAMAGE = (
    OSError,
    ValueError,
    TypeError,
    KeyError,
    EOFError,
    MemoryError,
    NotImplementedError,
    zipfile.BadZipFile,
    zlib.error,
)


@dataclass(frozen=True, eq=False)
class Gel:
    """One pad's elastic response, for a Young's modulus of 1 MPa. Can be pickled and copied.

    Attributes:
        layout_digest: of the pad's layout.
        thickness_mm, poisson, marker_depth_mm: of the elastomer.
        margin_mm: width of the gel beyond the layout's outline.
        outline_mm: (P, 2) float64, the gel's outline.
        loads_mm: (K, 2) float64, centres of loads exp(-r^2 / 2 width^2) on the touched face.
        spacing_mm, width_mm: of the loads.
        area_mm2: (K,) float64, force over peak traction of every load, inside the outline.
        matrix: (3 M, 3 K) float32, mm/MPa: displacement x, y, z of marker m in row 3 m by the traction x, y, z of load
            k in column 3 k.
    """

    layout_digest: str
    thickness_mm: float
    poisson: float
    marker_depth_mm: float
    margin_mm: float
    outline_mm: Array = field(repr=False)
    loads_mm: Array = field(repr=False)
    spacing_mm: float
    width_mm: float
    area_mm2: Array = field(repr=False)
    matrix: NDArray[np.float32] = field(repr=False)

    @property
    def digest(self) -> str:
        """SHA-256 (hex) of what the matrix depends on: layout, elastomer without its modulus, margin."""
        text = "|".join(
            [self.layout_digest]
            + [
                f"{value:.9g}"
                for value in (self.thickness_mm, self.poisson, self.marker_depth_mm, self.margin_mm)
            ]
        )
        return hashlib.sha256(text.encode()).hexdigest()

    def write(self, file: str | PathLike[str] | IO[bytes]) -> None:
        """Write the file, by its path or into a stream; the same gel gives the same bytes."""
        columns: dict[str, Any] = {part.name: getattr(self, part.name) for part in fields(self)}
        np.savez(file, format=np.array(FORMAT), digest=np.array(self.digest), **columns)

    def require_layout(self, layout: Reference) -> None:
        """Check that the gel is that of a layout.

        Raises:
            GelError: it is another pad's.
        """
        if layout.digest != self.layout_digest:
            raise GelError(
                f"the gel was made for the layout {self.layout_digest[:12]}, the layout here is "
                f"{layout.digest[:12]}; {HOW}"
            )


def load_gel(path: str | PathLike[str]) -> Gel:
    """Read a gel's file.

    Raises:
        GelError: the file is missing, of another format, or incomplete; one line with the remedy.
    """
    name = printable_path(path)
    try:
        data = read_bytes_file(path, MAX_BYTES, GelError, "the file of a gel")
    except GelError as error:
        raise GelError(f"{error}; {HOW}") from None
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            found = str(file["format"])
            values = {part.name: file[part.name] for part in fields(Gel)} if found == FORMAT else {}
            digest = str(file["digest"])
    except _DAMAGE as error:
        raise GelError(f"{name}: no file of a gel ({str(error)[:80]}); {HOW}") from None
    if not values:
        raise GelError(f"{name}: format {found[:40]!r}, expected {FORMAT!r}; {HOW}")
    gel = Gel(**{key: _plain(value) for key, value in values.items()})
    _check(gel, digest, name)
    return gel


def _plain(value: NDArray[Any]) -> Any:
    if value.ndim:
        value.setflags(write=False)
        return value
    return str(value) if value.dtype.kind == "U" else float(value)


def _check(gel: Gel, digest: str, name: str) -> None:
    loads = len(gel.loads_mm)
    good = (
        gel.matrix.ndim == 2
        and gel.matrix.dtype == np.float32
        and gel.matrix.shape[0] % 3 == 0
        and gel.matrix.shape[1] == 3 * loads
        and gel.area_mm2.shape == (loads,)
        and gel.thickness_mm > 0
        and bool(np.isfinite(gel.matrix).all())
    )
    if not good or digest != gel.digest:
        raise GelError(f"{name}: the columns contradict each other; {HOW}")
