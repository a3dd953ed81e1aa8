"""The layer's compliance: closed form, limits, real-space kernels, reciprocity, and a finite-element model."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cmpdesign.contact import ContactError, Elastomer
from cmpdesign.contact.elastic_layer.green import KERNEL_REACH_THICKNESSES, green_kernels
from cmpdesign.contact.elastic_layer.kernels import interior_compliances, layer_compliances
from cmpdesign.contact.elastic_layer.operator import ComplianceOperator

Array = NDArray[np.float64]
POISSONS = (0.0, 0.25, 0.3, 0.45, 0.49, 0.4999)


def four_equations(kh: float, nu: float, depth: float = 0.0) -> tuple[float, float, float, float]:
    """zz, xz, ll, zx for h = mu = 1 from two harmonic and two Papkovich-Neuber waves, one pair from each face."""
    k, lame = kh, 2 * nu / (1 - 2 * nu)

    def wave(sign: int, at: float, z: float, kind: int) -> tuple[float, float, float, float]:
        """U, W and their derivatives by z: u_x = i U, u_z = W; the wave is 1 at z = ``at``."""
        e, c = np.exp(sign * k * (z - at)), 3 - 4 * nu
        if kind == 0:
            return e, sign * e, sign * k * e, k * e
        y = k * (z - at)
        return y * e, (sign * y - c) * e, (k + sign * k * y) * e, (sign * k + sign * k * (sign * y - c)) * e

    waves = [(1, 0.0, 0), (1, 0.0, 1), (-1, -1.0, 0), (-1, -1.0, 1)]
    matrix = np.zeros((4, 4))
    for column, (sign, at, kind) in enumerate(waves):
        matrix[:2, column] = wave(sign, at, -1.0, kind)[:2]
        u, w, u_z, w_z = wave(sign, at, 0.0, kind)
        matrix[2, column] = (lame + 2) * w_z - lame * k * u
        matrix[3, column] = u_z + k * w
    here = np.array([wave(sign, at, -depth, kind)[:2] for sign, at, kind in waves]).T
    u_of_tz, w_of_tz = here @ np.linalg.solve(matrix, [0, 0, 1, 0])
    # t_x = i times the unit load makes u_x = i U, so U is the compliance along.
    u_of_tx, w_of_tx = here @ np.linalg.solve(matrix, [0, 0, 0, 1])
    if depth == 0:
        assert w_of_tx == pytest.approx(u_of_tz, rel=1e-6, abs=1e-12 / k)
    return float(w_of_tz), float(u_of_tz), float(u_of_tx), float(w_of_tx)


@pytest.mark.parametrize("nu", POISSONS)
def test_closed_form_solves_the_four_equations(nu: float) -> None:
    for kh in (0.03, 0.3, 1.0, 3.0, 30.0, 699.0, 1e4):
        c = layer_compliances(np.array([kh]), Elastomer(1.0, 2 * (1 + nu), nu))
        found = (c.zz[0], c.xz[0], c.ll[0], c.zx[0])
        np.testing.assert_allclose(found, four_equations(kh, nu), rtol=1e-6, atol=1e-9 / max(kh, 1))


@pytest.mark.parametrize("nu", POISSONS)
def test_interior_solves_the_four_equations(nu: float) -> None:
    for kh in (0.03, 0.3, 1.0, 3.0, 30.0, 300.0):
        for depth in (0.01, 0.2, 0.5, 0.97):
            c = interior_compliances(np.array([kh]), Elastomer(1.0, 2 * (1 + nu), nu), depth)
            found = (c.zz[0], c.xz[0], c.ll[0], c.zx[0])
            np.testing.assert_allclose(
                found, four_equations(kh, nu, depth), rtol=1e-5, atol=1e-9 / max(kh, 1)
            )


@pytest.mark.parametrize("nu", (*POISSONS, 0.5))
def test_interior_is_the_surface_at_depth_0_and_at_rest_at_the_support(nu: float) -> None:
    k = np.concatenate([[0.0], np.geomspace(1e-4, 1e3, 50)])
    elastomer = Elastomer(2.0, 1.0, nu)
    surface = layer_compliances(k, elastomer)
    for one, other in zip(interior_compliances(k, elastomer, 0.0), surface, strict=True):
        assert (np.abs(one - other) < 1e-11 * surface.ll).all()
    for values in interior_compliances(k, elastomer, 2.0):
        assert np.abs(values).max() == 0


@pytest.mark.parametrize("nu", (*POISSONS, 0.5))
def test_interior_of_a_thick_layer_is_that_of_the_half_space(nu: float) -> None:
    """Boussinesq's and Cerruti's solutions, wave by wave."""
    mu, k, depth = 3.0, np.array([0.5, 3.0, 20.0]), 0.3
    c = interior_compliances(k, Elastomer(1e3, 2 * mu * (1 + nu), nu), depth)
    y = k * depth
    decay = np.exp(-y) / (2 * mu * k)
    np.testing.assert_allclose(c.zz, decay * (2 - 2 * nu + y), rtol=1e-9)
    np.testing.assert_allclose(c.ll, decay * (2 - 2 * nu - y), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(c.xz, decay * (y - 1 + 2 * nu), rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(c.zx, -decay * (y + 1 - 2 * nu), rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(c.sh, 2 * decay, rtol=1e-12)


def test_interior_keeps_the_volume_below_it_and_uniform_loads_their_strain() -> None:
    k = np.array([0.0])
    below = interior_compliances(k, Elastomer(2.0, 3.0), 0.5)
    assert below.zz[0] == 0 and below.ll[0] == below.sh[0] == pytest.approx(1.5)
    drained = interior_compliances(k, Elastomer(2.0, 2.0, 0.0), 0.5)
    assert drained.zz[0] == pytest.approx(1.5 / 2.0)


@pytest.mark.parametrize("nu", (*POISSONS, 0.5))
def test_thin_limit(nu: float) -> None:
    """Long waves: a column squeezed between walls, simple shear; Reynolds' squeezed film when incompressible."""
    h, mu, k = 2.0, 3.0, np.array([0.0, 1e-6, 1e-4])
    c = layer_compliances(k, Elastomer(h, 2 * mu * (1 + nu), nu))
    squeezed = h * (1 - 2 * nu) / (2 * mu * (1 - nu))
    film = k**2 * h**3 / (3 * mu) if nu == 0.5 else 0.0
    np.testing.assert_allclose(c.zz, squeezed + film, rtol=2e-3 if nu == 0.4999 else 1e-6)
    np.testing.assert_allclose(c.xz, k * h**2 * (4 * nu - 1) / (4 * mu * (1 - nu)), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(c.ll, h / mu, rtol=1e-6)
    np.testing.assert_allclose(c.sh, h / mu, rtol=1e-6)


@pytest.mark.parametrize("nu", (*POISSONS, 0.5))
def test_thick_limit_is_the_half_space(nu: float) -> None:
    mu, k = 3.0, np.array([30.0, 1e4, 1e8])
    c = layer_compliances(k, Elastomer(1.0, 2 * mu * (1 + nu), nu))
    np.testing.assert_allclose(c.zz * mu * k, 1 - nu, rtol=1e-12)
    np.testing.assert_allclose(c.ll * mu * k, 1 - nu, rtol=1e-12)
    np.testing.assert_allclose(c.sh * mu * k, 1.0, rtol=1e-12)
    np.testing.assert_allclose(c.xz * mu * k, -(1 - 2 * nu) / 2, rtol=1e-12, atol=1e-12)


def test_no_cancellation_where_waves_are_long() -> None:
    """nu = 1/2 against the same formula in extended precision."""
    a = np.geomspace(2e-3, 2.0, 60)
    x = 2 * a.astype(np.longdouble)
    exact = (np.sinh(x) - x) / (x * (np.cosh(x) + 1 + x**2 / 2))
    np.testing.assert_allclose(layer_compliances(a, Elastomer(1.0, 3.0)).zz, exact.astype(float), rtol=1e-12)


def test_continuous_up_to_incompressible() -> None:
    k = np.geomspace(1e-2, 1e3, 40)
    whole, nearly = (layer_compliances(k, Elastomer(1.0, 1.0, nu)) for nu in (0.5, 0.5 - 1e-8))
    for one, other in zip(whole, nearly, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-7)


@given(nu=st.floats(0, 0.5), power=st.floats(-12, 12))
def test_a_load_always_does_work(nu: float, power: float) -> None:
    c = layer_compliances(np.array([10.0**power]), Elastomer(1.0, 1.0, nu))
    assert all(np.isfinite(value).all() for value in c)
    assert c.zz[0] >= 0 and c.ll[0] > 0 and c.sh[0] > 0
    assert c.zz[0] * c.ll[0] >= c.xz[0] ** 2


def test_pressure_pushes_outwards_when_incompressible() -> None:
    """The displacement is inwards on a thick compressible layer, as on a half-space."""
    for nu, thickness, sign in ((0.5, 1.0, 1), (0.3, 100.0, -1)):
        kernels = green_kernels(Elastomer(thickness, 1.0, nu), 0.1, 32)
        of_pressure = -kernels.xz[0, 5:20]
        assert (sign * of_pressure > 0).all()


@pytest.mark.parametrize(
    ("thickness", "nu"), [(0.3, 0.5), (3.0, 0.5), (3.0, 0.3), (50.0, 0.4999), (1e4, 0.3)]
)
def test_kernels_know_no_period(thickness: float, nu: float) -> None:
    """The same kernels from a grid of another extent, so with other periods."""
    elastomer = Elastomer(thickness, 1.0, nu)
    small, large = green_kernels(elastomer, 0.1, 40), green_kernels(elastomer, 0.1, 77)
    for name in ("zz", "xx", "xy", "xz"):
        one, other = getattr(small, name), getattr(large, name)[:40, :40]
        # Short waves end at the grid's shortest; what is compared is what a smooth load feels.
        smooth = np.outer(np.hanning(13)[1:-1], np.hanning(13)[1:-1]) / np.hanning(13).sum() ** 2
        error = [
            np.sum(smooth * (one - other)[i : i + 11, j : j + 11]) for i in (0, 8, 29) for j in (0, 14, 29)
        ]
        assert np.abs(error).max() < 2e-4 * np.abs(other).max(), name


def test_thick_layer_is_boussinesqs_half_space() -> None:
    """A square of 4 x 4 cells, far away a point load: (1 - nu) / (2 pi mu r) across, 1 / (2 pi mu r) along."""
    nu, step = 0.3, 0.1
    elastomer = Elastomer(1e6, 1.0, nu)
    operator = ComplianceOperator(green_kernels(elastomer, step, 128), (128, 128))
    distance = step * (np.arange(70, 128) - 3.5)
    unit = 16 * step**2 / (2 * np.pi * elastomer.shear_mpa * distance)
    for axis, expected in ((2, (1 - nu) * unit), (0, unit), (1, (1 - nu) * unit)):
        load = np.zeros((3, 128, 128))
        load[axis, 2:6, 2:6] = 1.0
        answer = operator(load)[:, 3:5, 70:].mean(axis=1)
        np.testing.assert_allclose(answer[axis], expected, rtol=2e-3)
        sideways = -(1 - 2 * nu) / 2 * unit if axis == 2 else (1 - 2 * nu) / 2 * unit * (axis == 0)
        other = {2: 0, 0: 2, 1: 2}[axis]
        np.testing.assert_allclose(answer[other], -sideways, rtol=2e-2, atol=2e-3 * unit.max())


def test_kernels_fade_within_their_reach() -> None:
    for nu in (0.3, 0.45, 0.5):
        kernels = green_kernels(Elastomer(1.0, 1.0, nu), 0.1, 160)
        for name in ("zz", "xx", "yy"):
            # Neighbours are averaged: the shortest wave of the grid rings on, and no smooth load feels it.
            values = 0.5 * (getattr(kernels, name)[0, 1:] + getattr(kernels, name)[0, :-1])
            assert (
                np.abs(values[int(10 * KERNEL_REACH_THICKNESSES) :]).max() < 3e-4 * np.abs(values[9:12]).max()
            ), (nu, name)


def random_loads(shape: tuple[int, int]) -> tuple[Array, Array]:
    generator = np.random.default_rng(5)
    one, other = generator.normal(size=(2, 3, *shape))
    return one, other


@pytest.mark.parametrize("nu", [0.3, 0.5])
@pytest.mark.parametrize("thickness", [0.2, 3.0, 1e3])
def test_reciprocity_and_energy(thickness: float, nu: float) -> None:
    operator = ComplianceOperator(green_kernels(Elastomer(thickness, 1.0, nu), 0.1, 24), (24, 17))
    one, other = random_loads((24, 17))
    there, back = np.sum(one * operator(other)), np.sum(other * operator(one))
    scale = np.sqrt(np.sum(one * operator(one)) * np.sum(other * operator(other)))
    assert abs(there - back) < 1e-12 * scale
    assert np.sum(one * operator(one)) > 0
    assert np.sum(one * operator(one)) <= operator.eigenvalue_bound(3) * np.sum(one * one)
    alone = operator(one[2:])
    np.testing.assert_allclose(alone[0], operator(one * [[[0]], [[0]], [[1]]])[2], atol=1e-12)
    assert np.sum(one[2:] * alone) <= operator.eigenvalue_bound(1) * np.sum(one[2:] * one[2:])
    single = operator(one.astype(np.float32))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, operator(one), atol=3e-6 * np.abs(operator(one)).max())


@pytest.mark.parametrize("nu", [0.3, 0.5])
@pytest.mark.parametrize("thickness", [0.2, 3.0, 1e3])
def test_preconditioner_is_symmetric_positive_and_near_the_inverse(thickness: float, nu: float) -> None:
    """The layer's response to the inverse nearly equals the input."""
    shape = (16, 12)
    operator = ComplianceOperator(green_kernels(Elastomer(thickness, 1.0, nu), 0.1, 32), shape)
    for components in (1, 3):
        one, other = (load[-components:].astype(np.float32) for load in random_loads(shape))
        there, back = np.vdot(one, operator.precondition(other)), np.vdot(other, operator.precondition(one))
        scale = np.sqrt(
            np.vdot(one, operator.precondition(one)) * np.vdot(other, operator.precondition(other))
        )
        assert abs(there - back) < 1e-5 * scale and np.vdot(one, operator.precondition(one)) > 0
        unit = np.eye(components * 16 * 12, dtype=np.float32).reshape(-1, components, *shape)
        product = np.stack([operator(operator.precondition(load)).ravel() for load in unit])
        found = np.abs(np.linalg.eigvals(product.astype(np.float64)))
        assert found.max() / found.min() < 10


def test_fourier_sum_is_the_plain_sum() -> None:
    kernels = green_kernels(Elastomer(0.7, 1.0, 0.4), 0.1, 20)
    operator = ComplianceOperator(kernels, (20, 9))
    load, _ = random_loads((20, 9))
    dy, dx = np.meshgrid(np.arange(20), np.arange(9), indexing="ij")
    for row, column in ((0, 0), (19, 8), (7, 3)):
        y, x = row - dy, column - dx
        near = np.abs(y), np.abs(x)
        xx, yy, zz = (getattr(kernels, name)[near] for name in ("xx", "yy", "zz"))
        xy = kernels.xy[near] * np.sign(x) * np.sign(y)
        xz, yz = kernels.xz[near] * np.sign(x), kernels.yz[near] * np.sign(y)
        expected = [
            np.sum(xx * load[0] + xy * load[1] + xz * load[2]),
            np.sum(xy * load[0] + yy * load[1] + yz * load[2]),
            np.sum(-xz * load[0] - yz * load[1] + zz * load[2]),
        ]
        np.testing.assert_allclose(operator(load)[:, row, column], expected, atol=1e-13)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ((0.0, 1.0, 0.5), "thickness_mm is 0; it must be above 0"),
        ((-1.0, 1.0, 0.5), "thickness_mm is -1"),
        ((1.0, 0.0, 0.5), "young_mpa is 0"),
        ((1.0, float("nan"), 0.5), "young_mpa is nan"),
        ((1.0, 1.0, 0.51), "poisson is 0.51; it must be from 0 to 0.5"),
        ((1.0, 1.0, -0.1), "poisson is -0.1"),
        ((1.0, 1.0, 0.5, 1.0), "marker_depth_mm is 1; it must be from 0 to below thickness_mm, 1"),
        ((1.0, 1.0, 0.5, -0.1), "marker_depth_mm is -0.1"),
    ],
)
def test_impossible_layers(values: tuple[float, ...], words: str) -> None:
    with pytest.raises(ContactError, match=words):
        Elastomer(*values)
