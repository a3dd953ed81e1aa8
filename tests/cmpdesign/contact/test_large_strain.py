"""The limit of linear theory: a round neo-Hookean layer in finite elements under growing pressure."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import skfem
from numpy.typing import NDArray

from benchmarks.large_strain.__main__ import compare
from benchmarks.large_strain.neo_hookean import NeoHookeanLayer
from cmpdesign.contact import Elastomer
from cmpdesign.contact.elastic_layer.green import green_kernels
from cmpdesign.contact.elastic_layer.operator import ComplianceOperator
from cmpdesign.contact.strain import LINEAR_STRAIN_LIMIT, largest_strain

Array = NDArray[np.float64]
LAYER = Elastomer(1.0, 1.0, 0.45)
RADIUS, FAR = 1.2, 5.0


def pressure(r: Array) -> Array:
    """The pressure is 1 in the middle and falls smoothly to zero at the radius."""
    return np.where(r < RADIUS, (1 - np.minimum(r / RADIUS, 1) ** 2) ** 2, 0.0)


class Layer:
    """Quadratic quadrilaterals in the half-plane (r, z); total Lagrangian, Newton's method."""

    def __init__(self) -> None:
        across = np.concatenate([np.linspace(0, 1.2, 6), np.geomspace(1.2, FAR, 7)[1:]])
        mesh = skfem.MeshQuad.init_tensor(across, np.array([-1.0, -0.75, -0.45, -0.2, 0.0]))
        element = skfem.ElementVector(skfem.ElementQuad2())
        self.basis = skfem.Basis(mesh, element, intorder=5)
        self.top = skfem.FacetBasis(
            mesh, element, facets=mesh.facets_satisfying(lambda x: np.isclose(x[1], 0))
        )
        support = self.basis.get_dofs(lambda x: np.isclose(x[1], -1) | np.isclose(x[0], FAR)).all()
        axis = self.basis.get_dofs(lambda x: np.isclose(x[0], 0)).all(["u^1"])
        self.held = np.unique(np.concatenate([support, axis]))

    def moved(self, load_mpa: float, newton: int) -> Array:
        """Displacement of the surface (2, N) at ``places`` after so many steps of Newton's method: 1 is linear."""

        @skfem.LinearForm
        def push(v: Any, w: Any) -> Any:
            return -load_mpa * pressure(w.x[0]) * v[1] * w.x[0]

        outer, u = push.assemble(self.top), np.zeros(self.basis.N)
        parts = 1 if newton == 1 else 2
        r = np.asarray(self.basis.global_coordinates())[0]
        for part in range(1, parts + 1):
            for _ in range(newton):
                stress, log, g = state(self.basis.interpolate(u), r)
                inner = resisting.assemble(self.basis, stress=stress)
                matrix = tangent.assemble(self.basis, log=log, g=g)
                step = skfem.solve(*skfem.condense(matrix, part / parts * outer - inner, D=self.held))
                u = u + step
        assert newton == 1 or np.abs(step).max() < 1e-5
        at = np.stack([places(), np.full(len(places()), -1e-9)])
        return np.asarray(self.basis.probes(at) @ u).reshape(2, -1)


def places() -> Array:
    return np.linspace(0.0, 3.0, 31)


def gradient(u: Any, r: Array) -> Array:
    """The displacement's gradient (3, 3, ...) in r, z and around."""
    found = np.zeros((3, 3, *r.shape))
    found[:2, :2] = u.grad
    found[2, 2] = u[0] / r
    return found


MU = LAYER.shear_mpa
LAME = 2 * MU * LAYER.poisson / (1 - 2 * LAYER.poisson)


def state(u: Any, r: Array) -> tuple[Array, Array, Array]:
    """First Piola-Kirchhoff stress, ln J and the transpose of F's inverse."""
    f = gradient(u, r) + np.eye(3)[:, :, None, None]
    last = np.moveaxis(f, (0, 1), (-2, -1))
    g = np.moveaxis(np.linalg.inv(last), (-2, -1), (1, 0))
    log = np.log(np.linalg.det(last))
    return MU * (f - g) + LAME * log * g, log, g


@skfem.LinearForm
def resisting(v: Any, w: Any) -> Any:
    return np.einsum("ij...,ij...->...", w["stress"], gradient(v, w.x[0])) * w.x[0]


@skfem.BilinearForm
def tangent(u: Any, v: Any, w: Any) -> Any:
    g, du, dv = w["g"], gradient(u, w.x[0]), gradient(v, w.x[0])
    answer = MU * np.einsum("ij...,ij...->...", du, dv)
    answer += (MU - LAME * w["log"]) * np.einsum("il...,kl...,kj...,ij...->...", g, du, g, dv, optimize=True)
    answer += LAME * np.einsum("kl...,kl...->...", g, du) * np.einsum("kl...,kl...->...", g, dv)
    return answer * w.x[0]


def linear_strain(load_mpa: float) -> tuple[float, Array]:
    """The result of the contact's solver for the same load: the largest strain, and the surface at ``places``."""
    cells, step = 161, 0.05
    x = step * (np.arange(cells) - cells // 2)
    traction = np.zeros((3, cells, cells))
    traction[2] = -load_mpa * pressure(np.hypot(*np.meshgrid(x, x)))
    moved = ComplianceOperator(green_kernels(LAYER, step, cells), (cells, cells))(traction)
    line = moved[:, cells // 2, cells // 2 :][:, :61:2]
    return largest_strain(LAYER, moved, traction, step), line[[0, 2]]


@pytest.mark.slow
def test_error_of_linear_theory_grows_with_the_strain() -> None:
    """About half of the strain, as a share of the largest displacement; five percent where the warning begins."""
    layer = Layer()
    for load in (0.1, 0.2):
        strain, line = linear_strain(load)
        linear, whole = layer.moved(load, 1), layer.moved(load, 5)
        size = np.abs(linear).max()
        assert np.abs(line - linear).max() < 0.003 * size, "the two linear layers are the same"
        assert 0.35 * strain < np.abs(whole - linear).max() / size < 0.6 * strain
    assert 0.9 * LINEAR_STRAIN_LIMIT < strain < LINEAR_STRAIN_LIMIT
    assert np.abs(whole - linear).max() < 0.05 * size


@pytest.mark.slow
def test_shapes_under_a_ball_are_those_of_a_neo_hookean_layer() -> None:
    """The surface's height in space to 2 % of the press at a strain of 0.2; read at the place at rest it is far off."""
    presses_mm = (0.4, 0.8)
    for press_mm, moved in zip(presses_mm, NeoHookeanLayer().pressed(presses_mm), strict=True):
        found = compare(press_mm, moved)
        assert found.height_mm < 0.02 * press_mm
        assert found.surface_mm < found.first_order_mm and found.markers_mm < 0.08 * press_mm
        assert abs(found.volume_lost_now) < 0.01 < -0.4 * found.volume_lost
