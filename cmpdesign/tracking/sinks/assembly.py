"""Chunks assembled into one .npz or .parquet file or one recording, with the memory of one chunk."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cmpdesign.files.atomic import staged_file
from cmpdesign.tracking.columns import Columns
from cmpdesign.tracking.recording.options import is_recording
from cmpdesign.tracking.sinks.chunk_files import Chunk, read_column, read_frames
from cmpdesign.tracking.sinks.unfinished import require_pyarrow
from cmpdesign.tracking.table import table_long_form


def assemble_table(chunks: Sequence[Chunk], about: Columns, path: Path) -> int:
    """Write chunks into one file; the number of frames.

    Args:
        chunks: complete chunks in order.
        about: the columns that all frames share.
        path: the table, .npz or .parquet; or a recording, which needs the columns of a ``RecordedTable``.

    Raises:
        OSError: the file cannot be written; an earlier file is unchanged.
    """
    if is_recording(path):
        _write_recording(chunks, about, path)
    else:
        with staged_file(path) as staged:
            (_write_npz if path.suffix == ".npz" else _write_parquet)(chunks, about, staged)
    return sum(len(chunk.frames) for chunk in chunks)


def _write_recording(chunks: Sequence[Chunk], about: Columns, path: Path) -> None:
    """Write the frames' messages; images lie beside the chunks."""
    from cmpdesign.tracking.recording.bag import write_recording
    from cmpdesign.tracking.recording.rrd import write_rrd

    if not chunks:
        raise OSError(0, "no frame was tracked")
    write = write_rrd if path.suffix == ".rrd" else write_recording
    write((read_frames(chunk) for chunk in chunks), about, path, chunks[0].path.parent)


def _write_npz(chunks: Sequence[Chunk], about: Columns, path: Path) -> None:
    """Write array by array and chunk by chunk."""
    frames = sum(len(chunk.frames) for chunk in chunks)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, values in about.items():
            with archive.open(_zip_member(name), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asarray(values), allow_pickle=False)
        for name, (dtype, shape) in chunks[0].kinds.items() if chunks else ():
            header = {
                "descr": np.lib.format.dtype_to_descr(dtype),
                "fortran_order": False,
                "shape": (frames, *shape),
            }
            with archive.open(_zip_member(name), "w", force_zip64=True) as file:
                np.lib.format.write_array_header_1_0(file, header)
                for chunk in chunks:
                    file.write(np.ascontiguousarray(read_column(chunk, name)).tobytes())


def _zip_member(name: str) -> zipfile.ZipInfo:
    """A zip member without a date."""
    member = zipfile.ZipInfo(f"{name}.npy")
    member.compress_type = zipfile.ZIP_DEFLATED
    return member


def _write_parquet(chunks: Sequence[Chunk], about: Columns, path: Path) -> None:
    """Write the long form with one row group per chunk."""
    arrow = require_pyarrow()
    if not chunks:
        raise OSError(0, "no frame was tracked")
    writer = None
    try:
        for chunk in chunks:
            long = table_long_form(read_frames(chunk), about)
            arrays = {
                name: arrow.array(values, from_pandas=values.dtype.kind == "f")
                for name, values in long.items()
            }
            table = arrow.table(arrays).replace_schema_metadata(_metadata(about))
            writer = writer or arrow.parquet.ParquetWriter(path, table.schema, compression="zstd")
            writer.write_table(table)
    finally:
        if writer is not None:
            writer.close()


def _metadata(about: Columns) -> dict[str, str]:
    """Of a Parquet file: the layout's digest, and when the frames' times begin."""
    texts: dict[str, str] = {
        name: str(about[name]) for name in ("digest", "times_of", "began_of") if name in about
    }
    if "began_unix_s" in about:
        texts["began_unix_s"] = repr(float(about["began_unix_s"]))
    return texts
