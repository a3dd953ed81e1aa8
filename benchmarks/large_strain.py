"""Linear contacts beside an incompressible neo-Hookean layer: a ball without friction, in round finite elements."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.sparse import bmat

from cmpdesign.contact import Ball, Contact, Elastomer, Motion, Relief, solve

Array = NDArray[np.float64]
PRESSES_MM = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
LAYER = Elastomer(4.0, 0.3, 0.5, 1.0)
# Radius of the ball; from there on the finite elements are at rest; side of the area that the linear contact covers.
RADIUS_MM, FAR_MM, SOLVED_MM = 10.0, 24.0, 64.0
# Penetration under a pressure of one shear modulus: 0.4 um.
PENALTY_PER_MODULUS = 2500.0
NEWTON_TOLERANCE_MM, LARGEST_NEWTON_STEP_MM, MOST_NEWTON_STEPS = 1e-5, 0.15, 60
PRESS_STEP_MM = 0.1


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
    """How far the surface is inside the ball, and the ball's slope and curvature there."""
    at = w.x[0] + u[0]
    root = np.sqrt(RADIUS_MM**2 - np.minimum(at, 0.9 * RADIUS_MM) ** 2)
    return np.maximum(u[1] - (RADIUS_MM - root - w["press"]), 0.0), at / root, RADIUS_MM**2 / root**3


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

    def __init__(self, elastomer: Elastomer = LAYER) -> None:
        self.elastomer = elastomer
        h = elastomer.thickness_mm
        across = np.concatenate([np.linspace(0, 9, 28), np.geomspace(9, FAR_MM, 9)[1:]])
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
        at = before = np.zeros(self.basis.N + self.pressures.N)
        steps = 0
        for wanted in presses_mm:
            while steps * PRESS_STEP_MM < wanted - 1e-9:
                steps += 1
                guess = 2 * at - before if steps > 2 else at
                before, at = at, self._solve(guess, steps * PRESS_STEP_MM)
            yield Moved(self._displacement(at, 0.0), self._displacement(at, self.elastomer.marker_depth_mm))

    def _displacement(self, at: Array, depth_mm: float) -> Array:
        places = np.stack([places_mm(), np.full(len(places_mm()), -max(depth_mm, 1e-9))])
        return np.asarray(self.basis.probes(places) @ at[: self.basis.N]).reshape(2, -1)

    def _solve(self, at: Array, press_mm: float) -> Array:
        mu, n = self.elastomer.shear_mpa, self.basis.N
        contact = {"press": press_mm, "penalty": PENALTY_PER_MODULUS * mu / 1.0}
        r = np.asarray(self.basis.global_coordinates())[0]
        for _ in range(MOST_NEWTON_STEPS):
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


class Comparison(NamedTuple):
    """One press: the largest distance of linear points from those of finite elements, mm.

    Attributes:
        press_mm: the press.
        strain: ``Contact.largest_strain``.
        first_order_mm: of the surface, whose z is read where points were at rest.
        surface_mm: of the surface, as ``Contact.surface`` gives it.
        markers_mm: of the pattern, as ``Contact.marker_layer`` gives it.
        height_mm: of the surface in z alone, at the same place in space.
        volume_lost: what the first-order surface loses, over the dent's volume.
        volume_lost_now: the same of ``Contact.surface``.
    """

    press_mm: float
    strain: float
    first_order_mm: float
    surface_mm: float
    markers_mm: float
    height_mm: float
    volume_lost: float
    volume_lost_now: float


def compare(press_mm: float, moved: Moved) -> Comparison:
    """The linear contact beside the neo-Hookean one."""
    contact = solve(
        LAYER, Ball(RADIUS_MM), Motion(press_mm), friction=0.0, size_mm=(SOLVED_MM, SOLVED_MM), grid=256
    )
    at, rest = places_mm(), np.stack([places_mm(), 0 * places_mm()], axis=1)
    surface, markers = (relief(rest)[:, [0, 2]].T for relief in (contact.surface(), contact.marker_layer()))
    wanted, wanted_markers = (np.stack([at + found[0], found[1]]) for found in moved)
    first = np.stack([surface[0], _spline_at_rest(contact, rest)])
    beside = np.interp(wanted[0], surface[0], surface[1])
    return Comparison(
        press_mm,
        contact.largest_strain,
        *(float(np.linalg.norm(a - b, axis=0).max()) for a, b in ((first, wanted), (surface, wanted))),
        float(np.linalg.norm(markers - wanted_markers, axis=0).max()),
        float(np.abs(beside - wanted[1]).max()),
        volume_lost(contact, first_order=True),
        volume_lost(contact, first_order=False),
    )


def _spline_at_rest(contact: Contact, xy_mm: Array) -> Array:
    """z (N,) mm read at the points' places at rest."""
    relief = contact.surface()
    without_press = relief.coefficients.copy()
    without_press[3:] = 0.0
    return Relief(relief.grid, without_press)(xy_mm)[:, 2]


def volume_lost(contact: Contact, *, first_order: bool) -> float:
    """The volume between the deformed and the flat surface, over that below the flat one; 0 if it is incompressible."""
    step = float(contact.x_mm[1] - contact.x_mm[0]) / 2
    relief = contact.surface()
    x, y = (np.arange(values[0] - 6.0, values[-1] + 6.0, step) for values in (contact.x_mm, contact.y_mm))
    xy = np.stack(np.meshgrid(x, y), axis=-1)
    moved = relief(xy.reshape(-1, 2)).reshape(*xy.shape[:2], 3)
    z = _spline_at_rest(contact, xy.reshape(-1, 2)).reshape(xy.shape[:2]) if first_order else moved[..., 2]
    x_y, x_x = np.gradient(moved[..., 0], step)
    y_y, y_x = np.gradient(moved[..., 1], step)
    volume = z * (x_x * y_y - x_y * y_x)
    return float(volume.sum() / -volume[z < 0].sum())


def main() -> int:
    """Print one row for every press."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    console = Console(width=140)
    table = Table(
        title=f"ball of {RADIUS_MM:g} mm without friction on {LAYER.thickness_mm:g} mm; largest errors in um of points "
        f"within {places_mm()[-1]:g} mm; pattern {LAYER.marker_depth_mm:g} mm below"
    )
    for name in (
        "press",
        "strain",
        "surface, z at rest",
        "surface",
        "its height",
        "pattern",
        "volume, z at rest",
        "volume",
    ):
        table.add_column(name, justify="right")
    for press, moved in zip(PRESSES_MM, NeoHookeanLayer().pressed(PRESSES_MM), strict=True):
        one = compare(press, moved)
        errors = (one.first_order_mm, one.surface_mm, one.height_mm, one.markers_mm)
        table.add_row(
            f"{press:g}",
            f"{one.strain:.2f}",
            *(f"{1e3 * error:.0f}" for error in errors),
            *(f"{100 * share:+.1f} %" for share in (one.volume_lost, one.volume_lost_now)),
        )
    console.print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
