"""The finite block's Green's matrix against other finite elements; the forward solver through the reader."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.force.neo_hookean_block import NeoHookeanBlock
from benchmarks.force.objects import RigidObject
from cmpdesign import build_layout
from cmpdesign.contact import Ball, ContactError, Elastomer, Motion, solve
from cmpdesign.contact.finite_block import make_gel
from cmpdesign.design.design import load_design
from extractor import ContactReader, ForceModel, Gel, Reference

LAYER = Elastomer(3.0, 0.3, 0.5, 0.5)


def small_pad(layers: int) -> Reference:
    return build_layout(load_design("honeycomb", {"layers": str(layers), "pitch_mm": "2"})).reference()


@pytest.fixture(scope="module")
def pad() -> Reference:
    return small_pad(3)


@pytest.fixture(scope="module")
def gel(pad: Reference) -> Gel:
    return make_gel(pad, LAYER)


def displacement_by_elements(pad: Reference, gel: Gel, load: int) -> NDArray[np.float64]:
    """(M, 3, 3) mm/MPa: quadratic tetrahedra with linear pressure."""
    x, y = gel.loads_mm[load]
    target = RigidObject("points", 1.0, ((float(x), float(y)),))
    block = NeoHookeanBlock(gel.outline_mm, 3.0, 1.0, 0.5, target, 0.0, fine_mm=0.8, fine_radius_mm=1.0)
    found = []
    for axis in range(3):
        found.append(block.linear_displacement(_load(gel, load, axis), pad.xy_mm, 0.5))
    return np.stack(found, axis=2)


def _load(gel: Gel, load: int, axis: int) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    def traction(places: NDArray[np.float64]) -> NDArray[np.float64]:
        offset = places[:, :2] - gel.loads_mm[load]
        values = np.zeros((len(places), 3))
        values[:, axis] = np.exp(-0.5 * (offset**2).sum(axis=1) / gel.width_mm**2)
        return values

    return traction


@pytest.mark.slow
@pytest.mark.parametrize("place", [(0.0, 0.0), (4.0, 1.0)])
def test_a_load_in_the_middle_and_one_near_the_wall(
    pad: Reference, gel: Gel, place: tuple[float, float]
) -> None:
    load = int(np.hypot(*(gel.loads_mm - place).T).argmin())
    wanted = displacement_by_elements(pad, gel, load)
    found = gel.matrix.reshape(len(pad.xy_mm), 3, -1, 3)[:, :, load]
    for axis in range(3):
        largest = np.abs(wanted[:, :, axis]).max()
        np.testing.assert_allclose(found[:, :, axis], wanted[:, :, axis], atol=0.07 * largest)


@pytest.mark.slow
def test_walls_matter_and_a_wide_margin_removes_them(pad: Reference, gel: Gel) -> None:
    wide = make_gel(pad, LAYER, margin_mm=6.0)
    at = [int(np.hypot(*(one.loads_mm - (4.0, 1.0)).T).argmin()) for one in (gel, wide)]
    narrow, broad = (
        one.matrix.reshape(len(pad.xy_mm), 3, -1, 3)[:, :, k] for one, k in zip((gel, wide), at, strict=True)
    )
    assert np.abs(narrow - broad)[:, 0, 0].max() > 0.05 * np.abs(broad[:, 0, 0]).max()
    assert wide.digest != gel.digest


@pytest.mark.slow
def test_the_forward_solver_and_the_reader_agree(pad: Reference) -> None:
    wide = make_gel(pad, LAYER, margin_mm=6.0)
    contact = solve(LAYER, Ball(5.0), Motion(0.2), friction=0.5, size_mm=(16, 16), grid=96)
    flat = np.pad(pad.xy_mm, [(0, 0), (0, 1)])
    moved = contact.marker_layer()(pad.xy_mm) - flat
    cov = np.tile(np.diag([1e-6, 1e-6, 1e-6]), (len(moved), 1, 1))
    moved += 1e-3 * np.random.default_rng(1).normal(size=moved.shape)
    found = ContactReader(pad, wide, LAYER.young_mpa, model=ForceModel(strain_factor=0.0)).read(moved, cov)
    # the forward solver's pattern is read at moved places, a second-order part that the reader does not have
    assert found.force_n[2] == pytest.approx(contact.force_n[2], rel=0.15)


def test_bad_input(pad: Reference) -> None:
    with pytest.raises(ContactError, match="margin_mm"):
        make_gel(pad, LAYER, margin_mm=-1.0)
    with pytest.raises(ContactError, match="thickness_mm"):
        Elastomer(0.0, 0.3)
