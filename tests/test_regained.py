"""What synthesis has lost: which gridlines are read around it, and that nothing else is touched."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cmpdesign.scene.standard import standard_layout
from cmpdesign.writers.layout_file import layout_to_json
from extractor import parse_layout
from extractor.regained import ELSEWHERE, _alone, _gridlines_around
from extractor.topology import Topology, topology_of


@cache
def mesh() -> Topology:
    return topology_of(parse_layout(layout_to_json(standard_layout("honeycomb", 6))))


@pytest.mark.parametrize("lost", [[0], [0, 1, 60], [90]])
def test_gridlines_around_come_first_and_few_others(lost: list[int]) -> None:
    own, which = mesh(), np.zeros(len(mesh().spokes), np.bool_)
    which[lost] = True
    read, count = _gridlines_around(which, own.edges)
    ring = set(lost) | {int(n) for e in own.edges[which[own.edges].any(axis=1)] for n in e}
    first = [e for e, (a, b) in enumerate(own.edges) if a in ring or b in ring]
    assert read[:count].tolist() == first
    others = [e for e in range(0, len(own.edges), ELSEWHERE) if e not in set(first)]
    assert read[count:].tolist() == others


def test_some_gridlines_alone_are_a_mesh_of_their_own() -> None:
    own = mesh()
    which = np.array([3, 7, 8, 40, 41, 100])
    markers, ends, around = _alone(which, own.edges, own.spokes)
    np.testing.assert_array_equal(markers[ends], own.edges[which])
    assert len(set(markers.tolist())) == len(markers) == len(around)
    for k, m in enumerate(markers):
        kept = np.isin(own.spokes[m], which)
        np.testing.assert_array_equal(around[k] >= 0, kept)
        np.testing.assert_array_equal(which[around[k][kept]], own.spokes[m][kept])
