"""The layer against a finite-element model that shares nothing with it: a quarter of a block, quadratic bricks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import skfem
from numpy.typing import NDArray
from skfem.helpers import ddot, eye, sym_grad, trace

from cmpdesign.contact import Elastomer
from cmpdesign.contact.elastic_layer.green import green_kernels
from cmpdesign.contact.elastic_layer.operator import ComplianceOperator, interior_displacement_mm

Array = NDArray[np.float64]
HALF_WIDTH = 3.6  # of the block, in thicknesses; by there the layer is at rest


def bump(x: Array, y: Array) -> Array:
    """A smooth load on the square from -1 to 1."""
    inside = (np.abs(x) < 1) & (np.abs(y) < 1)
    return np.where(inside, (1 - x**2) * (1 - y**2), 0.0)


def block() -> skfem.MeshHex:
    side = np.array([0, 0.3, 0.6, 0.85, 1, 1.25, 1.7, 2.5, HALF_WIDTH])
    down = np.array([-1.0, -0.6, -0.25, 0.0])
    return skfem.MeshHex.init_tensor(side, side, down)


def finite_elements(elastomer: Elastomer, places: Array) -> dict[int, Array]:
    """Displacement (3, N) at places (3, N) in x, y and z under ``bump`` along x (axis 0) and along z (2)."""
    mu, nu = elastomer.shear_mpa, elastomer.poisson
    lame = 2 * mu * nu / (1 - 2 * nu)
    mesh = block()
    element = skfem.ElementVector(skfem.ElementHex2())
    basis = skfem.Basis(mesh, element, intorder=4)
    top = skfem.FacetBasis(
        mesh, element, facets=mesh.facets_satisfying(lambda x: np.isclose(x[2], 0)), intorder=6
    )

    @skfem.BilinearForm
    def stiffness(u: Any, v: Any, _: Any) -> Any:
        strain = sym_grad(u)
        return ddot(2 * mu * strain + lame * eye(trace(strain), 3), sym_grad(v))

    matrix = stiffness.assemble(basis)
    probes = basis.probes(places)
    found = {}
    for axis in (0, 2):

        @skfem.LinearForm
        def load(v: Any, w: Any, axis: int = axis) -> Any:
            return bump(w.x[0], w.x[1]) * v[axis]

        system = skfem.condense(matrix, load.assemble(top), D=held(basis, axis))
        found[axis] = np.asarray(probes @ skfem.solve(*system)).reshape(3, -1)
    return found


def held(basis: skfem.Basis, axis: int) -> NDArray[np.int64]:
    """The support and the far sides, and the quarter's symmetry: along x a load makes u_y and u_z odd in x."""

    def on(side: int, place: float) -> Any:
        return basis.get_dofs(lambda x: np.isclose(x[side], place))

    far = [on(2, -1.0).all(), on(0, HALF_WIDTH).all(), on(1, HALF_WIDTH).all()]
    return np.unique(
        np.concatenate(
            [*far, on(1, 0.0).all(["u^2"]), on(0, 0.0).all(["u^1"] if axis == 2 else ["u^2", "u^3"])]
        )
    )


@pytest.mark.slow
@pytest.mark.parametrize(("nu", "limit"), [(0.3, 0.004), (0.45, 0.01)])
def test_layer_moves_as_finite_elements_say(nu: float, limit: float) -> None:
    """Displacements agree in all three directions, at and below the surface, under normal and tangential loads.

    The limit is a share of the surface's largest displacement.
    """
    elastomer = Elastomer(1.0, 1.0, nu)
    cells, step, depths = 121, 0.05, (0.0, 0.1, 0.25, 0.6)
    x = step * (np.arange(cells) - cells // 2)
    columns, rows = np.array([60, 66, 72, 78, 84, 92, 100]), np.array([60, 70, 60, 66, 72, 60, 64])
    places = np.concatenate(
        [np.stack([x[columns], x[rows], np.full(len(rows), -max(depth, 1e-9))]) for depth in depths], axis=1
    )
    for axis, expected in finite_elements(elastomer, places).items():
        load = np.zeros((3, cells, cells))
        load[axis] = bump(*np.meshgrid(x, x))
        largest = np.abs(expected).max()
        for depth, wanted in zip(depths, np.split(expected, len(depths), axis=1), strict=True):
            if depth == 0:
                moved = ComplianceOperator(green_kernels(elastomer, step, cells), (cells, cells))(load)
            else:
                moved = interior_displacement_mm(green_kernels(elastomer, step, cells, depth), load)
            error = np.abs(moved[:, rows, columns] - wanted).max() / largest
            assert error < limit, (axis, depth)
