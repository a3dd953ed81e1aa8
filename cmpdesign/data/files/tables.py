"""The tables beside the pictures: Parquet, one row a frame, the same columns in all shards of a data set.

Arrays are lists of numbers in C order: of V views and M markers, ``true_xy_px`` has V * M * 2 numbers. Lengths in px
and mm are float32, whose rounding is below 0.00004 px in pictures up to 1024 px wide.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact import Contact
from cmpdesign.data.frames.distributions import value_at, varying_leaves
from cmpdesign.data.frames.frame import FrameRecord, document_text
from cmpdesign.libraries import extra
from extractor import Markers

PREFIX = "scene."  # of the columns with drawn values
COMPRESSION = "zstd"
# Columns of every frame -> their Arrow types; types of lists are "list of ...".
HEAD = {
    "key": "string",
    "frame": "int64",
    "design": "string",
    "views": "int16",
    "width_px": "int32",
    "height_px": "int32",
    "redrawn": "int16",
    "warnings": "list of string",
    "parameters": "string",
}
CONTACT = {
    "force_n": "list of double",
    "moment_nmm": "list of double",
    "contact_mm2": "double",
    "slipping_mm2": "double",
    "largest_strain": "double",
}
TRUTH = {
    "rest_xy_px": "list of float",
    "true_xy_px": "list of float",
    "visible": "list of bool",
    "true_xyz_mm": "list of float",
}
MARKERS = {
    "xy_px": "list of float",
    "cov_px2": "list of float",
    "status": "list of uint8",
    "reason": "list of string",
}
Row = Mapping[str, Any]


def frame_columns(plan: Mapping[str, Any]) -> dict[str, str]:
    """The columns of a plan's tables and their types."""
    columns = HEAD | scene_columns(plan["scene"])
    if "contact" in plan["scene"]:
        columns |= CONTACT
    columns |= TRUTH
    return columns | MARKERS if plan["markers"]["read"] else columns


def scene_columns(scene: Mapping[str, Any]) -> dict[str, str]:
    """The columns of the values that differ from frame to frame: numbers, truth values, or texts."""
    kinds: dict[str, set[str]] = {}
    for path, example in varying_leaves(scene):
        kind = "string"
        if isinstance(example, bool):
            kind = "bool"
        elif isinstance(example, int | float):
            kind = "double"
        kinds.setdefault(f"{PREFIX}{path}", set()).add(kind)
    return {path: found.pop() if len(found) == 1 else "string" for path, found in kinds.items()}


def frame_row(frame: FrameRecord, columns: Mapping[str, str]) -> Row:
    """The row of a frame."""
    row: dict[str, Any] = {
        "key": frame_key(frame.number),
        "frame": frame.number,
        "design": frame.design,
        "views": len(frame.truth["visible"]),
        "width_px": frame.size_px[0],
        "height_px": frame.size_px[1],
        "redrawn": frame.redrawn,
        "warnings": list(frame.warnings),
        "parameters": document_text(frame.document),
    }
    for name, kind in columns.items():
        if name.startswith(PREFIX):
            row[name] = _as_kind(value_at(frame.document, name.removeprefix(PREFIX)), kind)
    if "force_n" in columns:
        row |= _contact_values(frame.contact)
    row |= {name: _flat(values) for name, values in frame.truth.items()}
    return row | marker_values(frame.markers) if "status" in columns else row


def frame_key(number: int) -> str:
    """The name of a frame in the tar file and in the table."""
    return f"{number:09d}"


def _as_kind(value: Any, kind: str) -> Any:
    if value is None:
        return None
    if kind == "string":
        return value if isinstance(value, str) else json.dumps(value)
    return bool(value) if kind == "bool" else float(value)


def _contact_values(contact: Contact | None) -> dict[str, Any]:
    """Forces and areas; 0 N without contact."""
    if contact is None:
        return {"force_n": [0.0] * 3, "moment_nmm": [0.0] * 3} | dict.fromkeys(list(CONTACT)[2:], 0.0)
    cell_mm2 = float((contact.x_mm[1] - contact.x_mm[0]) * (contact.y_mm[1] - contact.y_mm[0]))
    return {
        "force_n": contact.force_n.tolist(),
        "moment_nmm": contact.moment_nmm.tolist(),
        "contact_mm2": cell_mm2 * int(contact.in_contact.sum()),
        "slipping_mm2": cell_mm2 * int(contact.slipping.sum()),
        "largest_strain": float(contact.largest_strain),
    }


def marker_values(views: Sequence[Markers]) -> dict[str, Any]:
    """The markers of V views: xy_px (V, M, 2), cov_px2 (V, M, 3) as xx, xy, yy, status (V, M), reason (V,)."""
    cov = np.stack([markers.cov_px2 for markers in views])
    return {
        "xy_px": _flat(np.stack([markers.xy_px for markers in views])),
        "cov_px2": _flat(np.stack([cov[..., 0, 0], cov[..., 0, 1], cov[..., 1, 1]], axis=-1)),
        "status": _flat(np.stack([markers.status for markers in views])),
        "reason": ["" if markers.reason is None else str(markers.reason) for markers in views],
    }


def lost_values(count: int, reason: str) -> dict[str, Any]:
    """The values of one view of ``count`` markers in a picture that cannot be read, with the reason."""
    return {
        "xy_px": np.full(2 * count, np.nan, np.float32),
        "cov_px2": np.full(3 * count, np.nan, np.float32),
        "status": np.zeros(count, np.uint8),
        "reason": [reason],
    }


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    """(N,) in C order; float64 as float32."""
    flat = np.ascontiguousarray(values).reshape(-1)
    return flat.astype(np.float32) if flat.dtype == np.float64 else flat


def arrow_schema(columns: Mapping[str, str], about: Mapping[str, str]) -> Any:
    """The Arrow schema of columns, with texts on the whole table."""
    with extra("data"):
        import pyarrow

    makers: dict[str, Callable[[], Any]] = {
        "bool": pyarrow.bool_,
        "double": pyarrow.float64,
        "float": pyarrow.float32,
        "int16": pyarrow.int16,
        "int32": pyarrow.int32,
        "int64": pyarrow.int64,
        "string": pyarrow.string,
        "uint8": pyarrow.uint8,
    }
    fields = []
    for name, kind in columns.items():
        inner = makers[kind.removeprefix("list of ")]()
        fields.append((name, pyarrow.list_(inner) if kind.startswith("list of ") else inner))
    return pyarrow.schema(fields, metadata=dict(about))


def write_table(
    path: Path, rows: Sequence[Row], columns: Mapping[str, str], about: Mapping[str, str]
) -> None:
    """Write a Parquet file.

    Raises:
        OSError: the file cannot be written.
    """
    with extra("data"):
        import pyarrow
        import pyarrow.parquet

    schema = arrow_schema(columns, about)
    arrays = [pyarrow.array([row[field.name] for row in rows], type=field.type) for field in schema]
    table = pyarrow.Table.from_arrays(arrays, schema=schema)
    pyarrow.parquet.write_table(table, path, compression=COMPRESSION)
