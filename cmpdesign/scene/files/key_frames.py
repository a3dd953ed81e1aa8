"""Values that change over a sequence: piecewise linear between key frames, inserted into a document by dotted path."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np

from cmpdesign.inputs.names import nearest_name
from cmpdesign.scene.errors import SceneError

KeyFrames = tuple[tuple[float, float | tuple[float, ...]], ...]


def flatten_table(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Nested tables as one table with dotted paths: TOML reads contact.motion.press_mm = ... as tables in tables."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        path = f"{before}.{key}" if before else key
        flat |= flatten_table(value, path) if isinstance(value, Mapping) else {path: value}
    return flat


def interpolate_key_frames(keys: KeyFrames, time_s: float) -> float | list[float]:
    """The value at a time: linear between key frames, constant before the first and after the last."""
    times = [key[0] for key in keys]
    rows = np.array([key[1] for key in keys], dtype=np.float64)
    if rows.ndim == 1:
        return float(np.interp(time_s, times, rows))
    return [float(np.interp(time_s, times, column)) for column in rows.T]


def document_at_time(
    document: Mapping[str, Any], values: Mapping[str, KeyFrames], time_s: float
) -> dict[str, Any]:
    """A copy of the document with the values of all paths at a time.

    Raises:
        SceneError: a path does not exist in the document.
    """
    changed = copy.deepcopy(dict(document))
    for path, keys in values.items():
        *tables, last = path.split(".")
        target: Any = changed
        for depth, name in enumerate(tables):
            target = _find_table(target, name, path, ".".join(tables[:depth]))
        _update_value(target, last, interpolate_key_frames(keys, time_s), path)
    return changed


def _find_table(target: Any, name: str, path: str, parent_path: str) -> Any:
    known = [str(i) for i in range(len(target))] if isinstance(target, list) else list(target)
    if name not in known:
        inside = f" in {parent_path}" if parent_path else ""
        raise SceneError(
            f"[sequence] values.{path}: there is no {name}{inside}{nearest_name(name, known)}; "
            "give its starting value in the file"
        )
    found = target[int(name)] if isinstance(target, list) else target[name]
    if not isinstance(found, dict | list):
        raise SceneError(
            f"[sequence] values.{path}: {name} is a value, no table; leave out the names after it"
        )
    return found


def _update_value(target: Any, name: str, value: float | list[float], path: str) -> None:
    if isinstance(target, list):
        if not (name.isdecimal() and int(name) < len(target)):
            raise SceneError(f"[sequence] values.{path}: there is no {name}, it has 0 to {len(target) - 1}")
        target[int(name)] = value
    else:
        target[name] = value
