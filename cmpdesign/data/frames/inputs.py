"""The height maps and pictures of a plan, which become a part of the data set and are published with it.

A plan may come from somebody else. A file is taken only if the reader of height maps or pictures can read it, if a
scene can draw it, and if the file lies below the plan's folder or a folder that the caller names.
"""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cmpdesign.contact import ContactError
from cmpdesign.contact.objects.heightmap import HeightMap
from cmpdesign.data.frames.distributions import distribution_kind, is_drawn
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.files.images import ImageFileError, read_image
from cmpdesign.inputs.files import MAX_DATA_BYTES, read_file
from cmpdesign.inputs.sources import IMAGE_SUFFIXES


class TakenInputs(NamedTuple):
    """A scene whose paths lead into the data set, and the content of these files by their names."""

    scene: dict[str, Any]
    files: dict[str, bytes]


class _Place(NamedTuple):
    """The place of a path in a scene: the value's holder and key, its dotted name, and the kind beside the path."""

    holder: Any
    key: Any
    name: str
    kind: Any
    can_be_drawn: bool


def _read_height_map(path: Path) -> None:
    HeightMap.read(path, 1.0, None if path.suffix.lower() == ".npy" else 1.0)


# The kinds of tables with a path -> the reader of the file.
_READERS: Mapping[str, Callable[[Path], object]] = {"heightmap": _read_height_map, "picture": read_image}


def take_inputs(scene: Mapping[str, Any], plan: Path, inputs_from: Sequence[str | Path] = ()) -> TakenInputs:
    """Read the height maps and pictures that a scene names; paths start at the plan's folder.

    Args:
        scene: the scene, with distributions that were checked.
        plan: the plan's file.
        inputs_from: further folders whose files may be taken.

    Raises:
        CmpDesignError: a path that no draw can contain, a file outside of the folders, or a file that is no picture or
            height map.
    """
    taken: dict[str, bytes] = {}
    changed = {"scene": copy.deepcopy(dict(scene))}
    folders = [Path(folder).resolve() for folder in (plan.parent, *inputs_from)]
    for place in list(_places(changed["scene"], "scene", True)):
        path = plan.parent / place.holder[place.key]
        try:
            _check_place(place, path, folders)
        except (CmpDesignError, ContactError, ImageFileError) as error:
            raise CmpDesignError(f"{plan}: {place.name}: {error}") from None
        content = read_file(path, MAX_DATA_BYTES)
        ending = path.suffix.lower() if path.suffix.lower() in {*IMAGE_SUFFIXES, ".npy"} else ""
        name = f"inputs/{hashlib.sha256(content).hexdigest()[:16]}{ending}"
        taken[name] = content
        place.holder[place.key] = name
    return TakenInputs(changed["scene"], taken)


def _check_place(place: _Place, path: Path, folders: Sequence[Path]) -> None:
    if not isinstance(place.kind, str) or place.kind not in _READERS:
        raise CmpDesignError(f"a path stands beside kind = {' or '.join(_READERS)}; leave it out")
    if not place.can_be_drawn:
        raise CmpDesignError("no draw contains this path, by its chance, weight or repeat of 0; leave it out")
    try:
        is_below = any(path.resolve().is_relative_to(folder) for folder in folders)
    except (OSError, ValueError, RuntimeError) as error:  # a NUL, a loop of links
        raise CmpDesignError(f"{path}: cannot be read ({error})") from None
    if not is_below:
        raise CmpDesignError(
            f"{path} lies outside of the plan's folder; allow its folder by {parameter('inputs_from')}"
        )
    _READERS[place.kind](path)


def _places(value: Any, name: str, can_be_drawn: bool) -> Iterator[_Place]:
    """The paths in a scene, through all distributions."""
    for holder, key, can in _inner(value, can_be_drawn):
        if key == "path" and distribution_kind(value) is None:
            for place in _texts(holder, key, can):
                yield place._replace(name=f"{name}.path", kind=value.get("kind"))
        else:
            is_same = isinstance(value, dict) and distribution_kind(value) is not None
            yield from _places(holder[key], name if is_same else f"{name}.{key}", can)


def _texts(holder: Any, key: Any, can_be_drawn: bool) -> Iterator[_Place]:
    """The texts that a value can be: itself, or one of a choice."""
    if isinstance(holder[key], str):
        yield _Place(holder, key, "", None, can_be_drawn)
    for inner in _inner(holder[key], can_be_drawn):
        yield from _texts(*inner)


def _inner(value: Any, can_be_drawn: bool) -> list[tuple[Any, Any, bool]]:
    """(holder, key, whether a draw can contain it) of the values in a table, a list or a distribution."""
    if isinstance(value, dict):
        found = [(value, key, can_be_drawn and is_drawn(value, key)) for key in value]
        if isinstance(value.get("choice"), list):
            found = [
                (value["choice"], place, can_be_drawn and is_drawn(value, "choice", place))
                for place in range(len(value["choice"]))
            ]
        return found
    return [(value, place, can_be_drawn) for place in range(len(value))] if isinstance(value, list) else []
