"""A neo-Hookean block under rigid objects with friction: quadratic tetrahedra with linear pressure (Taylor and Hood).

Total Lagrangian, Newton's method. The object is a penalty on the touched face; friction is a return mapping at the
points of quadrature (Wriggers 2006, 5.2 and 6.2). The elements and their quadrature are those of scikit-fem. The block
shares no code and no mesh with the Green's matrix that is evaluated.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
import skfem
from numpy.typing import NDArray

from benchmarks.force.block_mesh import extrude, triangulate_outline
from benchmarks.force.objects import RigidObject

Array = NDArray[np.float64]
PENALTY_PER_MODULUS, STICK_PER_MODULUS = 40.0, 10.0  # of the modulus E, 1/mm
RAMP_MM = 0.004  # of penetration, over which the penalty grows to its full stiffness
TOLERANCE_MM, LARGEST_STEP_MM, MAX_STEPS = 1e-3, 0.2, 25
MIN_LIMIT = 1e-5  # of the modulus, where nothing has pressed before

try:  # a tenth of the time of SciPy's solver
    import pypardiso
except ImportError:
    pypardiso = None


class Pose(NamedTuple):
    """The object's motion: shift (x, y, z) mm, and turn about its centre's axis, degrees."""

    x_mm: float
    y_mm: float
    z_mm: float
    turn_deg: float = 0.0


class Wrench(NamedTuple):
    """Of the object on the block: force (3,) N and torque (3,) N mm about the layout's origin at the rest surface."""

    force_n: Array
    torque_nmm: Array


class NeoHookeanBlock:
    """The block. ``move`` follows the object to a pose; ``displacement`` and ``wrench`` state the result."""

    def __init__(
        self,
        outline_mm: Array,
        thickness_mm: float,
        young_mpa: float,
        poisson: float,
        target: RigidObject,
        friction: float,
        fine_mm: float = 1.1,
        fine_radius_mm: float = 3.0,
    ) -> None:
        self.mu = young_mpa / (2 * (1 + poisson))
        self.bulk_compliance = (1 - 2 * poisson) / (2 * self.mu * poisson)
        self.target, self.friction, self.young = target, friction, young_mpa
        centres = np.asarray(target.centres_mm)
        points, triangles = triangulate_outline(outline_mm, centres, fine_mm, fine_radius_mm, 4.0)
        h = thickness_mm
        levels = -h * np.array([1.0, 0.62, 0.32, 0.13, 0.0])
        mesh = skfem.MeshTet(*extrude(points, triangles, levels))
        mesh = skfem.MeshTet(mesh.p, _positive(mesh.p, mesh.t))
        self.basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP2()), intorder=2)
        scalar = self.basis.with_element(skfem.ElementTetP2())
        self.scalar = scalar
        pressure = self.basis.with_element(skfem.ElementTetP1())
        self.weights = self.basis.dx  # (T, Q)
        self.slopes = np.stack(
            [np.broadcast_to(b[0].grad, (3, *self.weights.shape)) for b in scalar.basis]
        )  # (10,3,T,Q)
        self.shapes = np.stack([np.broadcast_to(b[0], self.weights.shape) for b in pressure.basis])  # (4,T,Q)
        self.nodes, self.pressure_nodes = scalar.element_dofs, pressure.element_dofs  # (10,T), (4,T)
        self.place = np.zeros((scalar.N, 3))
        self.place[:] = scalar.doflocs.T
        top = mesh.facets_satisfying(lambda x: np.isclose(x[2], 0), boundaries_only=True)
        self.face = skfem.FacetBasis(mesh, skfem.ElementTetP2(), facets=top, intorder=4)
        self.face_weights = self.face.dx
        face_values = np.stack([np.broadcast_to(b[0], self.face_weights.shape) for b in self.face.basis])
        self.face_nodes = self.face.element_dofs
        on = (
            np.abs(face_values).max(axis=(1, 2)) >= 0
        )  # all ten nodes of the tetrahedra; those off the face are zero
        self.face_values = face_values[on]
        self.face_place = np.asarray(self.face.global_coordinates())  # (3,F,Q)
        self.free = np.flatnonzero(np.repeat(self.place[:, 2] > -h + 1e-9, 3))
        self.count, self.pressure_count = scalar.N, pressure.N
        self.u = np.zeros((self.count, 3))
        self.p = np.zeros(self.pressure_count)
        self.pose = Pose(0.0, 0.0, 0.0)
        self.pattern: _Pattern | None = None
        self.stick = np.zeros((self.face_weights.size, 3))
        self.face_u = np.zeros((self.face_weights.size, 3))
        self.last: _Contact | None = None
        self.last = self._contact(self.u, self.pose)

    def move(self, pose: Pose, largest_mm: float = 0.12) -> Wrench:
        """Follow the object in a straight line to a pose."""
        start = np.array(self.pose)
        way = np.array(pose) - start
        steps = max(1, int(np.ceil(max(np.abs(way[:3]).max() / largest_mm, abs(way[3]) / 3.0))))
        done, size = 0.0, 1.0 / steps
        while done < 1 - 1e-9:
            size = min(size, 1 - done)
            if self._advance(Pose(*(start + (done + size) * way))):
                done += size
            else:
                size /= 2
                if size < 1e-3:
                    raise RuntimeError(f"no convergence towards {pose}")
        return self.wrench()

    def wrench(self) -> Wrench:
        """The object's force and torque; arms are those of the deformed places."""
        force = self.last.traction * self.face_weights.reshape(-1, 1)
        at = self._face_points() + self.face_u
        return Wrench(force.sum(axis=0), np.cross(at, force).sum(axis=0))

    def pressure_map(self) -> tuple[Array, Array, Array]:
        """Places (N, 3), tractions (N, 3) MPa and areas (N,) of the touched face's points of quadrature, at rest."""
        return self._face_points(), self.last.traction, self.face_weights.ravel()

    def displacement(self, xy_mm: Array, depth_mm: float) -> Array:
        """(M, 3) mm of points at a depth."""
        at = np.column_stack([xy_mm, np.full(len(xy_mm), -max(depth_mm, 1e-7))]).T
        return np.asarray(self.scalar.probes(at) @ self.u).reshape(-1, 3)

    def linear_displacement(self, traction: Callable[[Array], Array], xy_mm: Array, depth_mm: float) -> Array:
        """(M, 3) mm of points at a depth, by linear theory, for tractions (N, 3) MPa at places (N, 3) of the face."""
        values = traction(self._face_points())
        none = np.zeros((len(values), 3, 3))
        rest = np.zeros_like(self.u)
        moved, _ = self._newton(rest, 0 * self.p, _Contact(values, 0 * values, none, 0 * values[:, 0]))
        at = np.column_stack([xy_mm, np.full(len(xy_mm), -max(depth_mm, 1e-7))]).T
        return np.asarray(self.scalar.probes(at) @ moved).reshape(-1, 3)

    def _face_points(self) -> Array:
        return np.asarray(np.moveaxis(self.face_place, 0, -1).reshape(-1, 3))

    def _advance(self, pose: Pose) -> bool:
        u, p = self.u.copy(), self.p.copy()
        before = np.inf
        for iteration in range(MAX_STEPS):
            contact = self._contact(u, pose) if iteration else self._expected(pose)
            du, dp = self._newton(u, p, contact)
            largest = np.abs(du).max()
            if not np.isfinite(largest) or largest > 50:
                return False
            share = min(1.0, LARGEST_STEP_MM / largest)
            if iteration > 3 and largest > 0.5 * before:
                share *= 0.5  # points that change between sticking and slipping would cycle
            before = largest
            u, p = u + share * du, p + share * dp
            if largest < TOLERANCE_MM:
                self.last = self._contact(u, pose)  # its slip counts from the pose before
                self.u, self.p, self.pose = u, p, pose
                self.stick, self.face_u = self.last.tangent, self._on_face(u)
                return True
        return False

    def _expected(self, pose: Pose) -> _Contact:
        """The contact after the object's motion to a pose, linearised where the block is: the same places touch."""
        last = self.last
        if not last.pressure.any():
            return self._contact(self.u, pose)
        x = self._face_points() + self.face_u
        (now, _), (before, turn) = self._object_frame(x, pose), self._object_frame(x, self.pose)
        carried = (before - now) @ turn.T
        return last._replace(traction=last.traction - np.einsum("nij,nj->ni", last.stiffness, carried))

    def _on_face(self, u: Array) -> Array:
        return np.asarray(np.einsum("aft,afi->fti", self.face_values, u[self.face_nodes]).reshape(-1, 3))

    def _object_frame(self, x: Array, pose: Pose) -> tuple[Array, Array]:
        """Points in the object's frame, and the rotation (3, 3) from it."""
        angle = np.radians(pose.turn_deg)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
        centre = np.append(np.mean(self.target.centres_mm, axis=0), 0.0)
        return (x - centre - np.array(pose[:3])) @ turn + centre, turn

    def _contact(self, u: Array, pose: Pose) -> _Contact:
        on = self._on_face(u)
        x = self._face_points() + on
        local, turn = self._object_frame(x, pose)
        gap, normal = self.target.gap(local)
        touching = gap < 0
        penalty, grip = PENALTY_PER_MODULUS * self.young, STICK_PER_MODULUS * self.young
        deep = np.where(touching, -gap, 0.0)
        pressure = penalty * np.where(deep < RAMP_MM, deep**2 / (2 * RAMP_MM), deep - RAMP_MM / 2)
        normal = normal @ turn.T
        curved = np.zeros((len(x), 3, 3))
        curved[touching] = np.einsum("ij,njk,lk->nil", turn, self.target.turn(local[touching]), turn)
        flat = np.eye(3) - normal[:, :, None] * normal[:, None, :]
        _, before_turn = self._object_frame(x, self.pose)
        # the object's material point at x now was at x - carried before this increment
        centre = np.append(np.mean(self.target.centres_mm, axis=0), 0.0)
        carried = x - ((local - centre) @ before_turn.T + centre + np.array(self.pose[:3]))
        slip = on - self.face_u - carried
        # a point that has just been touched has slipped over nothing yet
        held = grip * (self.last.pressure > 0)[:, None] if self.last is not None else 0.0 * touching[:, None]
        pull = self.stick - held * slip
        trial = np.einsum("nij,nj->ni", flat, pull)
        # The limit is that of the pressure before this increment, and the way from sticking to slipping is smooth:
        # both keep Newton's method convergent, and the tractions are in equilibrium with the block all the same.
        limit = (
            self.friction * (self.last.pressure if self.last is not None else pressure)
            + MIN_LIMIT * self.young
        )
        root = np.sqrt(limit**2 + (trial**2).sum(axis=1))
        ratio = np.where(touching, limit / root, 0.0)
        tangent = ratio[:, None] * trial
        d_pressure = -penalty * np.minimum(deep / RAMP_MM, 1.0)[:, None] * normal
        stiff = normal[:, :, None] * d_pressure[:, None, :] + pressure[:, None, None] * curved
        along = (normal * pull).sum(axis=1)
        turned = np.einsum("nji,nj->ni", curved, pull)
        d_trial = (
            -held[:, :, None] * flat - along[:, None, None] * curved - normal[:, :, None] * turned[:, None, :]
        )
        unit = trial / root[:, None]
        slide = ratio[:, None, None] * ((np.eye(3) - unit[:, :, None] * unit[:, None, :]) @ d_trial)
        return _Contact(pressure[:, None] * normal + tangent, tangent, stiff + slide, pressure)

    def _newton(self, u: Array, p: Array, contact: _Contact) -> tuple[Array, Array]:
        w, slopes, shapes = self.weights, self.slopes, self.shapes
        f = np.einsum("aJtq,ati->iJtq", slopes, u[self.nodes], optimize=True)
        f[np.arange(3), np.arange(3)] += 1.0
        last = np.moveaxis(f, (0, 1), (-2, -1))
        g = np.moveaxis(np.linalg.inv(last), (-2, -1), (1, 0))
        j = np.linalg.det(last)
        pressure = np.einsum("btq,bt->tq", shapes, p[self.pressure_nodes])
        mu = self.mu
        stress = mu * (f - g) - pressure * j * g
        inner = np.einsum("aJtq,iJtq,tq->ait", slopes, stress, w, optimize=True)
        swell = np.einsum("btq,tq->bt", shapes, -(j - 1 + self.bulk_compliance * pressure) * w, optimize=True)
        ga = np.einsum("iJtq,aJtq->aitq", g, slopes, optimize=True)
        one = np.einsum("aJtq,bJtq,tq->tab", slopes, slopes, mu * w, optimize=True)
        tangled = _pairs(ga * ((mu + pressure * j) * w), ga)  # (t, a, i, b, k): ga_ai gb_bk
        same = _pairs(ga * (pressure * j * w), ga)
        # (G dF' G): G_iL dF_kL G_kJ -> slope_bL G_iL = ga_b i ; slope_aJ G_kJ = ga_a k
        matrix = np.swapaxes(tangled, 2, 4) - same
        for i in range(3):
            matrix[:, :, i, :, i] += one
        coupling = -np.einsum("aitq,btq->taib", ga, shapes * (j * w), optimize=True)
        squeeze = -np.einsum("atq,btq->tab", shapes, shapes * (self.bulk_compliance * w), optimize=True)
        return self._solve(inner, swell, matrix, coupling, squeeze, contact)

    def _solve(
        self, inner: Array, swell: Array, matrix: Array, coupling: Array, squeeze: Array, contact: _Contact
    ) -> tuple[Array, Array]:
        n, m = 3 * self.count, self.pressure_count
        dof = (3 * self.nodes.T[:, :, None] + np.arange(3)).reshape(len(self.nodes.T), -1)
        face_dof = (3 * self.face_nodes.T[:, :, None] + np.arange(3)).reshape(len(self.face_nodes.T), -1)
        p_dof = n + self.pressure_nodes.T
        residual = np.zeros(n + m)
        np.add.at(residual, dof, np.moveaxis(inner, 2, 0).reshape(len(dof), -1))
        np.add.at(residual, p_dof, swell.T)
        shape = self.face_weights.shape
        t = contact.traction.reshape(*shape, 3)
        push = np.einsum("aft,fti,ft->fai", self.face_values, t, self.face_weights)
        np.add.at(residual, face_dof, -push.reshape(len(face_dof), -1))
        stiff = contact.stiffness.reshape(*shape, 3, 3) * self.face_weights[..., None, None]
        faces = np.zeros((len(face_dof), 10, 3, 10, 3))
        touched = np.flatnonzero(np.abs(stiff).max(axis=(1, 2, 3)) > 0)
        on = self.face_values[:, touched]
        faces[touched] = -np.einsum("aft,ftij,bft->faibj", on, stiff[touched], on, optimize=True)
        parts = [matrix, coupling, np.moveaxis(coupling.reshape(len(dof), 30, 4), 1, 2), squeeze, faces]
        values = np.concatenate([part.ravel() for part in parts])
        pattern = self._pattern(dof, p_dof, face_dof)
        keep = np.concatenate([self.free, n + np.arange(m)])
        step = np.zeros(n + m)
        step[keep] = pattern.solve(values, -residual[keep])
        return step[:n].reshape(-1, 3), step[n:]

    def _pattern(self, dof: Any, p_dof: Any, face_dof: Any) -> _Pattern:
        if self.pattern is None:
            new = np.full(3 * self.count + self.pressure_count, -1)
            keep = np.concatenate([self.free, 3 * self.count + np.arange(self.pressure_count)])
            new[keep] = np.arange(len(keep))
            pairs = [(dof, dof), (dof, p_dof), (p_dof, dof), (p_dof, p_dof), (face_dof, face_dof)]
            rows = np.concatenate([np.repeat(new[a], b.shape[1], axis=1).ravel() for a, b in pairs])
            columns = np.concatenate([np.tile(new[b], (1, a.shape[1])).ravel() for a, b in pairs])
            self.pattern = _Pattern(rows, columns, len(keep))
        return self.pattern


class _Pattern:
    """The sparse matrix of the equations: its places are sorted once."""

    def __init__(self, rows: Any, columns: Any, size: int) -> None:
        self.used = np.flatnonzero((rows >= 0) & (columns >= 0))
        key, self.at = np.unique(
            rows[self.used].astype(np.int64) * size + columns[self.used], return_inverse=True
        )
        self.indices = (key % size).astype(np.int32)
        self.indptr = np.searchsorted(key, size * np.arange(size + 1, dtype=np.int64)).astype(np.int32)
        self.size, self.pardiso = size, None

    def solve(self, values: Array, right: Array) -> Array:
        data = np.bincount(self.at, values[self.used], minlength=len(self.indices))
        matrix = sp.csr_matrix((data, self.indices, self.indptr), (self.size, self.size))
        if pypardiso is None:
            return np.asarray(sp.linalg.spsolve(matrix.tocsc(), right))
        if self.pardiso is None:
            self.pardiso = pypardiso.PyPardisoSolver(mtype=11)
            self.pardiso.set_phase(13)
        else:
            self.pardiso.set_phase(23)
        return np.asarray(self.pardiso._call_pardiso(matrix, right[:, None])).ravel()


class _Contact(NamedTuple):
    """At the face's points of quadrature: traction, its tangential part (N, 3), derivative by u, pressure (N,)."""

    traction: Array
    tangent: Array
    stiffness: Array
    pressure: Array


def _pairs(left: Array, right: Array) -> Array:
    """(t, a, i, b, k) sums over q of left (a, i, t, q) times right (b, k, t, q)."""
    a, i, t, q = left.shape
    one = np.ascontiguousarray(np.moveaxis(left, 2, 0)).reshape(t, a * i, q)
    two = np.ascontiguousarray(np.moveaxis(right, 2, 0)).reshape(t, a * i, q)
    return np.asarray((one @ np.swapaxes(two, 1, 2)).reshape(t, a, i, a, i))


def _positive(p: Array, t: NDArray[np.int64]) -> NDArray[np.int64]:
    a, b, c, d = (p[:, t[k]] for k in range(4))
    volume = np.einsum("it,it->t", np.cross((b - a).T, (c - a).T).T, d - a)
    turned = t.copy()
    turned[:, volume < 0] = t[:, volume < 0][[0, 2, 1, 3]]
    return turned
