"""An incompressible neo-Hookean layer under a ball without friction: round finite elements."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from typing import Any, NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import bmat

from cmpdesign.contact import Elastomer

Array = NDArray[np.float64]
LAYER = Elastomer(4.0, 0.3, 0.5, 1.0)
# Radius of the ball; distance from the axis at which the elements are held.
RADIUS_MM, FAR_MM = 10.0, 24.0
# Penetration under a pressure of one shear modulus: 0.4 um.
PENALTY_PER_MODULUS = 2500.0
NEWTON_TOLERANCE_MM, LARGEST_NEWTON_STEP_MM, MAX_NEWTON_STEPS = 1e-5, 0.15, 60
PRESS_STEP_MM = 0.1
NEAR_MM = np.linspace(0, 9, 28)  # nodes from the axis


class Moved(NamedTuple):
    """Displacement (2, N) mm in r and z of the points at ``places_mm``, at the surface and at the markers' depth."""

    surface_mm: Array
    markers_mm: Array


def places_mm() -> Array:
    """(N,) mm from the axis, at rest."""
    return np.linspace(0.0, 12.0, 49)


def _gradient(u: Any, r: Array) -> Array:
    """The displacement's gradient (3, 3, ...) in r, z and around."""
    found = np.zeros((3, 3, *r.shape))
    found[:2, :2] = u.grad
    found[2, 2] = u[0] / r
    return found


def _cofactor(f: Array) -> tuple[Array, Array]:
    """The transpose of F's inverse (3, 3, ...), and J."""
    last = np.moveaxis(f, (0, 1), (-2, -1))
    return np.moveaxis(np.linalg.inv(last), (-2, -1), (1, 0)), np.linalg.det(last)


@skfem.LinearForm
def _resisting(v: Any, w: Any) -> Any:
    stress = w["mu"] * w["f"] - w["p"] * w["j"] * w["g"]
    return np.einsum("ij...,ij...->...", stress, _gradient(v, w.x[0])) * w.x[0]


@skfem.LinearForm
def _swelling(q: Any, w: Any) -> Any:
    return -(w["j"] - 1) * q * w.x[0]


@skfem.BilinearForm
def _stiffness(u: Any, v: Any, w: Any) -> Any:
    g, du, dv = w["g"], _gradient(u, w.x[0]), _gradient(v, w.x[0])
    of_u, of_v = (np.einsum("ij...,ij...->...", g, d) for d in (du, dv))
    turned = np.einsum("il...,kl...,kj...,ij...->...", g, du, g, dv, optimize=True)
    return (w["mu"] * np.einsum("ij...,ij...->...", du, dv) - w["p"] * w["j"] * (of_u * of_v - turned)) * w.x[
        0
    ]


@skfem.BilinearForm
def _coupling(u: Any, q: Any, w: Any) -> Any:
    return -w["j"] * np.einsum("ij...,ij...->...", w["g"], _gradient(u, w.x[0])) * q * w.x[0]


def _ball(u: Any, w: Any) -> tuple[Array, Array, Array]:
    """Depth of the surface inside the ball, and the ball's slope and curvature there."""
    at = w.x[0] + u[0]
    radius = w["radius"]
    root = np.sqrt(radius**2 - np.minimum(at, 0.9 * radius) ** 2)
    return np.maximum(u[1] - (radius - root - w["press"]), 0.0), at / root, radius**2 / root**3


@skfem.LinearForm
def _pushing(v: Any, w: Any) -> Any:
    inside, slope, _ = _ball(w["u"], w)
    return w["penalty"] * inside * (v[1] - slope * v[0]) * w.x[0]


@skfem.BilinearForm
def _pushing_stiffness(u: Any, v: Any, w: Any) -> Any:
    inside, slope, curvature = _ball(w["u"], w)
    across = (u[1] - slope * u[0]) * (v[1] - slope * v[0])
    return w["penalty"] * (np.where(inside > 0, across, 0.0) - inside * curvature * u[0] * v[0]) * w.x[0]


class NeoHookeanLayer:
    """Taylor-Hood quadrilaterals in the half-plane (r, z); total Lagrangian, Newton's method; the ball by a penalty."""

    def __init__(
        self, elastomer: Elastomer = LAYER, radius_mm: float = RADIUS_MM, near_mm: Array = NEAR_MM
    ) -> None:
        self.elastomer, self.radius_mm = elastomer, radius_mm
        self.penalty = PENALTY_PER_MODULUS * elastomer.shear_mpa
        h = elastomer.thickness_mm
        across = np.concatenate([near_mm, np.geomspace(near_mm[-1], FAR_MM, 9)[1:]])
        up = -h * np.array([1.0, 0.85, 0.65, 0.45, 0.28, 0.13, 0.05, 0.0])
        mesh = skfem.MeshQuad.init_tensor(across, up)
        element = skfem.ElementVector(skfem.ElementQuad2())
        self.basis = skfem.Basis(mesh, element, intorder=4)
        self.pressures = self.basis.with_element(skfem.ElementQuad1())
        top = mesh.facets_satisfying(lambda x: np.isclose(x[1], 0))
        self.top = skfem.FacetBasis(mesh, element, facets=top, intorder=6)
        held = self.basis.get_dofs(lambda x: np.isclose(x[1], -h) | np.isclose(x[0], FAR_MM)).all()
        axis = self.basis.get_dofs(lambda x: np.isclose(x[0], 0)).all(["u^1"])
        self.held = np.unique(np.concatenate([held, axis]))

    def pressed(self, presses_mm: tuple[float, ...]) -> Iterator[Moved]:
        """The layer at every one of growing presses."""
        states, at, step = self.states(), np.empty(0), 0
        for wanted in presses_mm:
            while step * PRESS_STEP_MM < wanted - 1e-9:
                step, at = step + 1, next(states)
            depths_mm = 0.0, self.elastomer.marker_depth_mm
            yield Moved(*(self.displacement(at, places_mm(), depth_mm) for depth_mm in depths_mm))

    def states(self) -> Iterator[Array]:
        """The unknowns at presses that grow by ``PRESS_STEP_MM``."""
        at = before = np.zeros(self.basis.N + self.pressures.N)
        for step in count(1):
            before, at = at, self._solve(2 * at - before if step > 2 else at, step * PRESS_STEP_MM)
            yield at

    def displacement(self, at: Array, away_mm: Array, depth_mm: float) -> Array:
        """(2, N) mm in r and z of points at distances from the axis, at a depth."""
        places = np.stack([away_mm, np.full(len(away_mm), -max(depth_mm, 1e-9))])
        return np.asarray(self.basis.probes(places) @ at[: self.basis.N]).reshape(2, -1)

    def _solve(self, at: Array, press_mm: float) -> Array:
        mu, n = self.elastomer.shear_mpa, self.basis.N
        contact = {"press": press_mm, "penalty": self.penalty, "radius": self.radius_mm}
        r = np.asarray(self.basis.global_coordinates())[0]
        for _ in range(MAX_NEWTON_STEPS):
            f = _gradient(self.basis.interpolate(at[:n]), r) + np.eye(3)[:, :, None, None]
            g, j = _cofactor(f)
            state = {"f": f, "g": g, "j": j, "p": np.asarray(self.pressures.interpolate(at[n:])), "mu": mu}
            touch = {**contact, "u": self.top.interpolate(at[:n])}
            stiffness = _stiffness.assemble(self.basis, **state) + _pushing_stiffness.assemble(
                self.top, **touch
            )
            coupling = _coupling.assemble(self.basis, self.pressures, **state)
            matrix = bmat([[stiffness, coupling.T], [coupling, None]], "csr")
            residual = np.concatenate(
                [
                    _resisting.assemble(self.basis, **state) + _pushing.assemble(self.top, **touch),
                    _swelling.assemble(self.pressures, **state),
                ]
            )
            step = skfem.solve(*skfem.condense(matrix, -residual, D=self.held))
            largest = np.abs(step[:n]).max()
            at = at + step * min(1.0, LARGEST_NEWTON_STEP_MM / largest)
            if largest < NEWTON_TOLERANCE_MM:
                return at
        raise RuntimeError(f"Newton's method has not converged at a press of {press_mm:g} mm")
