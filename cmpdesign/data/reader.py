"""Reading of data sets: frames one by one, or Arrow tables of many frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.data.files.webdataset import Member, read_member, read_members
from cmpdesign.data.folder import finished_records, number_of_shards, read_plan, shard_name
from cmpdesign.data.named_files import named_layouts
from cmpdesign.data.records import ShardRecord
from cmpdesign.errors import InputError
from cmpdesign.files.images import Image, ImageFileError, decode_bytes
from cmpdesign.inputs.documents import parse_json
from cmpdesign.libraries import extra
from extractor import Reference

# Columns that are arrays of V views -> numbers a marker.
_BY_VIEW = {"rest_xy_px": 2, "true_xy_px": 2, "visible": 0, "xy_px": 2, "cov_px2": 3, "status": 0}
_ENDINGS = {"images": ".tar", "tables": ".parquet"}
_KEPT_SHARDS = 4  # tables and lists of members


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame of a data set: V views of M markers.

    Attributes:
        values: the columns of the frame's row that are no arrays: frame, design, force_n, "scene.optics.blur_px" and so
            on.
        arrays: name -> values: rest_xy_px, true_xy_px and xy_px (V, M, 2) px, cov_px2 (V, M, 3) as xx, xy, yy,
            status and visible (V, M), true_xyz_mm (M, 3); NaN where a marker is lost.
        image_bytes: the encoded picture; b"" of markers that were extracted from a source.
    """

    values: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]
    image_bytes: bytes

    @property
    def image(self) -> Image:
        """The picture, (H, W, 3) BGR.

        Raises:
            ImageFileError: the frame has no picture.
        """
        if not self.image_bytes:
            raise ImageFileError("the frame has no picture; the pictures of an extraction are in its sources")
        pixels: Image = np.ascontiguousarray(decode_bytes(self.image_bytes, "frame")[:, :, :3])
        return pixels

    @property
    def parameters(self) -> Mapping[str, Any]:
        """The drawn scene, as in a scene file; empty for an extraction."""
        document: Mapping[str, Any] = json_object(self.values.get("parameters"))
        return document


class DataSet:
    """The finished shards of a data set; ``load`` makes it.

    A number in brackets gives a frame; iteration gives all frames, shard by shard. A ``DataSet`` can be pickled.

    Attributes:
        folder: the data set.
        plan: the object of plan.json.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self.plan = read_plan(self.folder)
        self._records: Sequence[ShardRecord] = finished_records(self.folder)
        self._numbers = frozenset(self.shards)
        self._ends = np.cumsum([record.frames for record in self._records], dtype=np.int64)

    def __len__(self) -> int:
        return int(self._ends[-1]) if len(self._ends) else 0

    def __repr__(self) -> str:
        return f"<DataSet: {len(self)} frames in {len(self.shards)} of {number_of_shards(self.plan)} shards>"

    @property
    def complete(self) -> bool:
        """Whether all shards of the plan are finished."""
        return len(self._records) == number_of_shards(self.plan)

    @property
    def shards(self) -> tuple[int, ...]:
        """The numbers of the finished shards."""
        return tuple(record.shard for record in self._records)

    @cached_property
    def layouts(self) -> Mapping[str, Reference]:
        """The layouts by the designs' names; of an extraction one layout with the name ""; see ``named_layouts``."""
        return named_layouts(self.folder, self.plan)

    def table(self, columns: Sequence[str] | None = None, shards: Iterable[int] | None = None) -> Any:
        """An Arrow table of all frames, or of the frames of some shards.

        Args:
            columns: names of columns; None: all.
            shards: numbers of shards; None: all.

        Raises:
            InputError: no such column or shard.
        """
        with extra("data"):
            import pyarrow

        wanted = self.shards if shards is None else tuple(shards)
        tables = [self._read_table(shard, columns) for shard in wanted]
        if not tables:
            raise InputError(f"{self.folder}: holds no finished shard")
        return pyarrow.concat_tables(tables)

    def frames(self, shards: Iterable[int] | None = None) -> Iterator[Frame]:
        """The frames of some shards, or of all, in their order; one shard is in memory at a time."""
        for shard in self.shards if shards is None else shards:
            rows = self._read_table(shard, None)
            members = self._members(shard)
            for place in range(rows.num_rows):
                yield self._frame(shard, rows, place, members)

    def __iter__(self) -> Iterator[Frame]:
        return self.frames()

    def __getitem__(self, place: int) -> Frame:
        if not -len(self) <= place < len(self):
            raise IndexError(f"frame {place}: the data set has {len(self)} frames")
        place %= len(self)
        at = int(np.searchsorted(self._ends, place, side="right"))
        record = self._records[at]
        row = place - int(self._ends[at] - record.frames)
        shard = record.shard
        return self._frame(shard, _kept_table(self._path(shard, "tables")), row, self._members(shard))

    def _frame(self, shard: int, rows: Any, place: int, members: Mapping[str, Member]) -> Frame:
        row = rows.slice(place, 1)
        values, arrays = {}, {}
        views = row["views"][0].as_py() if "views" in row.column_names else 1
        for name in row.column_names:
            if name in _BY_VIEW or name == "true_xyz_mm":
                flat = row[name].combine_chunks().flatten().to_numpy(zero_copy_only=False)
                arrays[name] = _shaped(name, flat, views)
            else:
                values[name] = row[name][0].as_py()
        image = b""
        if members:
            image = read_member(self._path(shard, "images"), members[values["key"]])
        return Frame(values, arrays, image)

    def _members(self, shard: int) -> Mapping[str, Member]:
        """The places of the pictures of a shard, by the frames' keys; empty for an extraction."""
        has_images = "image" in self.plan
        return _kept_members(self._path(shard, "images")) if has_images else {}

    def _path(self, shard: int, kind: str) -> Path:
        if shard not in self._numbers:
            raise InputError(f"{self.folder}: shard {shard} is missing; make the shard first")
        return self.folder / kind / f"{shard_name(shard)}{_ENDINGS[kind]}"

    def _read_table(self, shard: int, columns: Sequence[str] | None) -> Any:
        path = self._path(shard, "tables")
        if columns is None:
            return _read_parquet(path, None)
        known = _read_schema(path).names
        strange = [name for name in columns if name not in known]
        if strange:
            raise InputError(f"{path}: has no column {strange[0]}; there are {', '.join(known)}")
        return _read_parquet(path, list(columns))


def load(folder: str | Path) -> DataSet:
    """Open a data set of ``cmpdesign dataset`` or ``cmpdesign extract``, also one that is not complete.

    >>> frames = cmpdesign.data.load("pressed")
    >>> frames[0].image.shape, frames[0].values["force_n"], frames[0].arrays["true_xyz_mm"]
    >>> frames.table(["force_n", "scene.contact.motion.press_mm"]).to_pandas()

    Raises:
        CmpDesignError: the folder holds no data set.
    """
    return DataSet(Path(folder))


def json_object(text: str | None) -> Any:
    """The object of a JSON text; an empty object for None."""
    return {} if text is None else parse_json(text, "parameters")


def _shaped(name: str, flat: NDArray[Any], views: int) -> NDArray[Any]:
    if name == "true_xyz_mm":
        return flat.reshape(-1, 3)
    width = _BY_VIEW[name]
    return flat.reshape(views, -1, width) if width else flat.reshape(views, -1)


@contextmanager
def _damage_told(path: Path) -> Iterator[None]:
    """Within this context, an error of a missing or damaged table has a remedy."""
    with extra("data"):
        import pyarrow

    try:
        yield
    except (pyarrow.ArrowException, OSError) as error:
        raise InputError(
            f"{path}: cannot be read ({str(error).splitlines()[0]}); delete shards/{path.stem}.json beside it, and the "
            "command that made the data set makes the shard again"
        ) from None


def _read_parquet(path: Path, columns: list[str] | None) -> Any:
    with extra("data"):
        import pyarrow.parquet

    with _damage_told(path):
        return pyarrow.parquet.read_table(path, columns=columns, partitioning=None).combine_chunks()


def _read_schema(path: Path) -> Any:
    with extra("data"):
        import pyarrow.parquet

    with _damage_told(path):
        return pyarrow.parquet.read_schema(path)


@lru_cache(maxsize=_KEPT_SHARDS)
def _kept_table(path: Path) -> Any:
    return _read_parquet(path, None)


@lru_cache(maxsize=_KEPT_SHARDS)
def _kept_members(path: Path) -> Mapping[str, Member]:
    """The pictures by the frames' keys."""
    members = read_members(path)
    return {name.partition(".")[0]: member for name, member in members.items() if not name.endswith(".json")}
