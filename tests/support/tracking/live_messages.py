"""The messages of the page's live part, read as the page reads them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np


def unpacked(message: bytes) -> dict[str, Any]:
    """The document, its columns as arrays (a row a marker), and ``rest``, the bytes that follow."""
    at = 4 + int.from_bytes(message[:4], "little")
    told: dict[str, Any] = json.loads(message[4:at])
    for name, count in told["columns"].items():
        told[name] = np.frombuffer(message, "<f4", count, at)
        at += 4 * count
    for name in ("place", "moved"):
        told[name] = told[name].reshape(-1, 3 if told["in_space"] else 2)
    return {**told, "ids": told["ids"].astype(int), "rest": message[at:]}
