"""An order of elimination with little fill: nested dissection of places by straight cuts (George 1973)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LEAF = 12  # places that are not cut further


def dissection_order(places: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
    """The order of places (N, 2) on a grid; places nearer than ``reach`` in both directions are connected."""
    order: list[NDArray[np.int64]] = []
    _dissect(places, np.arange(len(places)), reach, order)
    return np.concatenate(order)


def _dissect(
    places: NDArray[np.int64], part: NDArray[np.int64], reach: int, order: list[NDArray[np.int64]]
) -> None:
    spans = np.ptp(places[part], axis=0)
    axis = int(spans.argmax())
    if len(part) <= LEAF or spans[axis] < 2 * reach:
        order.append(part)
        return
    along = places[part, axis]
    cut = int(np.median(along)) - reach // 2
    before, after = part[along < cut], part[along >= cut + reach]
    for side in (before, after):
        if len(side):
            _dissect(places, side, reach, order)
    order.append(part[(along >= cut) & (along < cut + reach)])
