"""Solved contacts: the classical limits, energy, convergence with the grid, friction, and the surface handed out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.contact import (
    Ball,
    Contact,
    Cube,
    Cylinder,
    Elastomer,
    HeightMap,
    Motion,
    Punch,
    Rib,
    Ring,
    Wedge,
    solve,
    solve_path,
)

Array = NDArray[np.float64]
THICK = 1e5
LAYER = Elastomer(4.0, 0.3)


def contact_area(found: Contact) -> float:
    return float(np.count_nonzero(found.in_contact) * (found.x_mm[1] - found.x_mm[0]) ** 2)


@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_thick_layer_under_a_ball_is_hertz(nu: float) -> None:
    radius, press, young = 10.0, 0.01, 1.0
    a, stiff = math.sqrt(radius * press), young / (1 - nu**2)
    found = solve(
        Elastomer(THICK, young, nu), Ball(radius), Motion(press), friction=0, size_mm=(3 * a, 3 * a), grid=96
    )
    assert -found.force_n[2] == pytest.approx(4 / 3 * stiff * math.sqrt(radius) * press**1.5, rel=0.004)
    assert contact_area(found) == pytest.approx(math.pi * a**2, rel=0.02)
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    inside = 1 - (x**2 + y**2) / a**2
    hertz = 2 / math.pi * stiff * math.sqrt(press / radius) * np.sqrt(np.maximum(inside, 0))
    assert np.abs(-found.traction_mpa[..., 2] - hertz)[np.abs(inside) > 0.1].max() < 0.02 * hertz.max()


@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_thick_layer_under_a_flat_punch(nu: float) -> None:
    """Sneddon: 2 E* a d."""
    found = solve(
        Elastomer(THICK, 1.0, nu), Punch(1.0), Motion(1e-3), friction=0, size_mm=(2.5, 2.5), grid=128
    )
    assert -found.force_n[2] == pytest.approx(2 / (1 - nu**2) * 1e-3, rel=0.008)


def test_thin_layer_under_a_ball_is_a_mattress() -> None:
    """Compressible and thin: pressure is the depth times M / h, so the force is pi R d^2 M / h."""
    nu, h, radius, press = 0.2, 0.02, 100.0, 0.002
    squeezed = (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    found = solve(
        Elastomer(h, 1.0, nu), Ball(radius), Motion(press), friction=0, size_mm=(1.6, 1.6), grid=160
    )
    assert -found.force_n[2] == pytest.approx(math.pi * radius * press**2 * squeezed / h, rel=0.04)


def test_thin_incompressible_layer_is_a_squeezed_film() -> None:
    """Flat and round: p = 3 mu d (a^2 - r^2) / (4 h^3) where a >> h, force 3 pi mu d a^4 / (8 h^3)."""
    h, a, press, mu = 0.1, 4.0, 1e-3, 1.0
    found = solve(Elastomer(h, 3 * mu), Punch(a), Motion(press), friction=0, size_mm=(10, 10), grid=200)
    assert -found.force_n[2] == pytest.approx(3 * math.pi * mu * press * a**4 / (8 * h**3), rel=0.2)
    middle = -found.traction_mpa[100, 100, 2]
    assert middle == pytest.approx(3 * mu * press * a**2 / (4 * h**3), rel=0.15)
    out = found.displacement_mm[100, found.x_mm > a, 0]
    assert out[0] > 0 and found.displacement_mm[100, found.x_mm > a, 2].max() > 0


def test_force_converges_with_the_grid() -> None:
    """First order or better against a fine grid, for a smooth object."""
    steps, errors = [], []
    fine = solve(LAYER, Ball(10.0), Motion(0.8), friction=0, size_mm=(20, 20), grid=360).force_n[2]
    for grid in (24, 32, 45, 64, 90):
        found = solve(LAYER, Ball(10.0), Motion(0.8), friction=0, size_mm=(20, 20), grid=grid)
        steps.append(20 / grid)
        errors.append(abs(found.force_n[2] / fine - 1))
    rate = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert rate > 1.0 and errors[-1] < 0.003


@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_work_is_stored(nu: float) -> None:
    """Without friction, the force along the path agrees with half of traction times displacement."""
    way = [Motion(0.5 * i / 24) for i in range(1, 25)]
    layer = Elastomer(3.0, 0.5, nu)
    path = list(solve_path(layer, Ball(8.0), way, friction=0, size_mm=(14, 14), grid=64))
    force = np.array([0.0] + [-found.force_n[2] for found in path])
    depth = np.array([0.0] + [motion.press_mm for motion in way])
    work = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(depth))
    last, cell = path[-1], (14 / 64) ** 2
    stored = 0.5 * np.sum(last.traction_mpa * last.displacement_mm) * cell
    assert work == pytest.approx(stored, rel=0.01)


def test_sticking_returns_its_work() -> None:
    """If the whole contact sticks, shear is elastic: half of the force times the path; after the way back, no force
    remains.
    """
    way = [Motion(0.2), Motion(0.2, (0.02, 0.0)), Motion(0.2)]
    pressed, sheared, back = solve_path(
        LAYER, Punch(3.0, 0.5), way, friction=math.inf, size_mm=(14, 14), grid=64
    )
    energy = [
        0.5 * np.sum(one.traction_mpa * one.displacement_mm) * (14 / 64) ** 2 for one in (pressed, sheared)
    ]
    assert energy[1] - energy[0] == pytest.approx(0.5 * sheared.force_n[0] * 0.02, rel=0.1)
    assert abs(back.force_n[0]) < 0.01 * sheared.force_n[0]
    np.testing.assert_allclose(back.displacement_mm, pressed.displacement_mm, atol=5e-4)


def cattaneo(share: float, nu: float = 0.5) -> tuple[Contact, float, float]:
    """A ball on a thick layer, sheared by a share of the shear at full slip; the contact, and the radius of contact."""
    radius, press, rub = 10.0, 0.01, 0.3
    a, mu = math.sqrt(radius * press), 1 / (2 * (1 + nu))
    force = 4 / 3 / (1 - nu**2) * math.sqrt(radius) * press**1.5
    all_slips = 3 * rub * force * (2 - nu) / (16 * mu * a)
    motion = Motion(press, (share * all_slips, 0.0))
    layer = Elastomer(THICK, 1.0, nu)
    found = solve(layer, Ball(radius), motion, friction=rub, size_mm=(3 * a, 3 * a), grid=64, steps=2)
    return found, a, rub


def test_partial_slip_is_cattaneo_and_mindlin() -> None:
    """Q = mu P (1 - (1 - d / d_slip)^(3/2)), and a disc of radius a sqrt(1 - d / d_slip) sticks."""
    found, a, rub = cattaneo(0.6)
    assert found.force_n[0] / -found.force_n[2] == pytest.approx(rub * (1 - 0.4**1.5), rel=0.01)
    sticks = found.in_contact & ~found.slipping
    assert math.sqrt(sticks.sum() * (3 * a / 64) ** 2 / math.pi) == pytest.approx(
        a * math.sqrt(0.4), rel=0.04
    )
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    assert np.hypot(x, y)[sticks].max() < 0.72 * a


def test_total_slip_takes_all_friction() -> None:
    found, _, rub = cattaneo(5.0)
    shear = np.hypot(found.traction_mpa[..., 0], found.traction_mpa[..., 1]).sum()
    assert shear == pytest.approx(rub * -found.traction_mpa[..., 2].sum(), rel=1e-3)
    assert found.force_n[0] == pytest.approx(rub * -found.force_n[2], rel=0.01)
    assert np.count_nonzero(found.slipping) > 0.99 * np.count_nonzero(found.in_contact)


@pytest.mark.parametrize("motion", [Motion(0.5, (0.3, 0.1)), Motion(0.5, twist_deg=8.0)])
def test_friction_obeys_coulomb(motion: Motion) -> None:
    """Traction is nowhere above the limit; slip is against friction; sticking points have moved with the object."""
    before, found = list(
        solve_path(LAYER, Ball(8.0), [Motion(0.5), motion], friction=0.4, size_mm=(16, 16), grid=64)
    )
    pressure = -found.traction_mpa[..., 2]
    shear = np.hypot(found.traction_mpa[..., 0], found.traction_mpa[..., 1])
    assert (pressure >= 0).all() and (shear <= 0.4 * pressure * 1.03 + 1e-3 * pressure.max()).all()
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    place = np.stack([x, y]) + np.moveaxis(before.displacement_mm, -1, 0)[:2]
    ridden = motion.carried(place, (0.0, 0.0)) - place
    slid = np.moveaxis(found.displacement_mm - before.displacement_mm, -1, 0)[:2] - ridden
    sticks = found.in_contact & before.in_contact & ~found.slipping
    assert sticks.any() and found.slipping.any()
    assert np.sqrt(np.mean(slid[:, sticks] ** 2)) < 2e-3
    along = np.sum(slid * np.moveaxis(found.traction_mpa, -1, 0)[:2], axis=0)[
        found.slipping & before.in_contact
    ]
    assert (along <= 1e-4).all() and along.min() < -1e-3


def test_twist_of_a_stuck_punch_is_reissner_and_sagoci() -> None:
    """Torque 16 / 3 mu a^3 theta; and 8 mu a d / (2 - nu) for a shift."""
    layer, mu = Elastomer(THICK, 1.0), 1 / 3
    for motion, got, wanted in (
        (Motion(1e-3, twist_deg=0.01), 5, 16 / 3 * mu * math.radians(0.01)),
        (Motion(1e-3, (1e-4, 0.0)), 0, 8 * mu / 1.5 * 1e-4),
    ):
        found = solve(layer, Punch(1.0), motion, friction=math.inf, size_mm=(2.5, 2.5), grid=128, steps=1)
        assert np.concatenate([found.force_n, found.moment_nmm])[got] == pytest.approx(wanted, rel=0.015)


def test_torque_of_a_far_twist_is_what_the_support_takes() -> None:
    """Arms and tractions of one frame, the flat layer's: near 16 / 3 mu a^3 sin(twist) for a stuck punch."""
    found = solve(
        Elastomer(THICK, 1.0),
        Punch(1.0),
        Motion(0.05, twist_deg=30.0),
        friction=math.inf,
        size_mm=(2.5, 2.5),
        grid=64,
    )
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    area = (found.x_mm[1] - found.x_mm[0]) ** 2
    torque = float(np.sum(x * found.traction_mpa[..., 1] - y * found.traction_mpa[..., 0])) * area
    assert found.moment_nmm[2] == pytest.approx(torque, rel=1e-4)
    assert torque == pytest.approx(16 / 9 * math.sin(math.radians(30.0)), rel=0.15)


def test_moment_is_about_the_object_where_it_is() -> None:
    """A sticking punch, sheared by half of its radius, moves its load; without friction the punch slides to a new
    load.
    """
    for friction in (math.inf, 0.0):
        found, pressed = (
            solve(LAYER, Punch(2.0, 0.5), motion, friction=friction, size_mm=(14, 14), grid=56, steps=2)
            for motion in (Motion(0.3, (0.0, 1.0)), Motion(0.3))
        )
        lever_mm = np.abs(found.moment_nmm[:2]) / -found.force_n[2]
        assert lever_mm[1] < 1e-3, "nothing turns it about y"
        assert np.abs(pressed.moment_nmm).max() < 1e-3 * -pressed.force_n[2]
        assert lever_mm[0] < (1e-3 if friction == 0 else 0.8)


def test_twist_is_counter_clockwise_and_far_twists_slip() -> None:
    found = solve(
        LAYER, Ball(8.0, centre_mm=(1.0, -2.0)), Motion(0.5, twist_deg=10), size_mm=(16, 16), grid=64
    )
    row, column = np.abs(found.y_mm + 2).argmin(), np.abs(found.x_mm - 2.5).argmin()
    assert found.displacement_mm[row, column, 1] > 0.05
    assert found.moment_nmm[2] > 0 and np.abs(found.force_n[:2]).max() < 0.02 * -found.force_n[2]


def test_symmetry() -> None:
    """A load along y gives the turned result of a load along x; mirrored loads give mirrored results."""
    along_x = solve(LAYER, Ball(9.0), Motion(0.6, (0.3, 0.0)), size_mm=(18, 18), grid=48)
    along_y = solve(LAYER, Ball(9.0), Motion(0.6, (0.0, 0.3)), size_mm=(18, 18), grid=48)
    turned = np.swapaxes(along_x.displacement_mm, 0, 1)[..., [1, 0, 2]]
    np.testing.assert_allclose(along_y.displacement_mm, turned, atol=2e-3)
    mirrored = along_x.displacement_mm[::-1] * (1, -1, 1)
    np.testing.assert_allclose(along_x.displacement_mm, mirrored, atol=2e-3)


def test_moving_the_object_moves_the_answer() -> None:
    step = 18 / 48
    here = solve(LAYER, Cube(5.0), Motion(0.3), friction=0, size_mm=(18, 18), grid=48)
    there = solve(
        LAYER, Cube(5.0, centre_mm=(4 * step, 0)), Motion(0.3), friction=0, size_mm=(18, 18), grid=48
    )
    np.testing.assert_allclose(here.traction_mpa[:, :-4], there.traction_mpa[:, 4:], atol=1e-3)


def test_pressure_bulges_the_surface_beside_the_object() -> None:
    found = solve(LAYER, Ball(8.0), Motion(0.8), friction=0, size_mm=(24, 24), grid=96)
    middle = found.displacement_mm[48]
    assert middle[:, 2].min() == pytest.approx(-0.8, abs=2e-3)
    beside = found.x_mm > 4.5
    assert middle[beside, 2].max() > 0.02 and (middle[beside & (found.x_mm < 8), 0] > 0).all()


def test_friction_holds_the_surface_while_it_is_pressed() -> None:
    free, held = (
        solve(LAYER, Ball(8.0), Motion(0.8), friction=rub, size_mm=(20, 20), grid=64) for rub in (0, 1)
    )
    outwards = [one.displacement_mm[32, :, 0].max() for one in (free, held)]
    assert outwards[1] < 0.95 * outwards[0] and held.force_n[2] < free.force_n[2]


def test_friction_needs_few_increments() -> None:
    """Twice the increments change the surface by little."""
    one, other = (
        solve(LAYER, Ball(10.0), Motion(1.0, (0.5, 0)), friction=0.5, size_mm=(20, 20), grid=48, steps=steps)
        for steps in (4, 8)
    )
    change = np.abs(one.displacement_mm - other.displacement_mm)
    assert change.max() < 0.03 and np.sqrt(np.mean(change**2)) < 0.005


@pytest.mark.parametrize(
    "thing",
    [Ball(6.0), Cylinder(5.0, 8.0, 30.0), Ring(4.0, 1.0), Rib(2.0, 9.0), Wedge(100.0, 8.0), Cube(6.0), Punch(3.0, 0.4)],
    ids=lambda thing: type(thing).__name__,
)  # fmt: skip
def test_every_object_lies_on_the_surface(thing: Ball) -> None:
    """The surface in contact is on the object, the surface beside is below the object, and no pressure is negative."""
    found = solve(LAYER, thing, Motion(0.4), friction=0, size_mm=(16, 16), grid=80)
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    gap = thing.height_mm(x, y) - 0.4 - found.displacement_mm[..., 2]
    assert found.in_contact.any() and found.residual_mm < 1e-4
    assert np.abs(gap[found.in_contact]).max() < 2e-3
    assert gap[~found.in_contact].min() > -2e-3
    assert (found.traction_mpa[..., 2] <= 0).all()
    assert found.force_n[2] < 0


@pytest.mark.parametrize("motion", [Motion(1.0, (0.8, 0.0)), Motion(1.0, twist_deg=20.0)])
def test_sheared_and_twisted_contacts_take_few_answers(motion: Motion) -> None:
    """Most of a contact's time is the layer's response: eight increments, of which four are solved twice."""
    found = solve(LAYER, Ball(12.0), motion, size_mm=(24, 24), grid=96)
    assert found.iterations < 360 and not [one for one in found.warnings if "solver" in one]


def test_much_friction_is_solved_too() -> None:
    """The limit depends so much on the pressure that an update at every step does not converge."""
    for thing, layer in (
        (Ring(4.0, 1.0), Elastomer(THICK, 0.3, 0.3)),
        (Cube(6.0, 0.3), Elastomer(10.0, 0.3, 0.3)),
    ):
        found = solve(layer, thing, Motion(0.45, twist_deg=40.0), friction=3.0, size_mm=(20, 20), grid=64)
        assert not [one for one in found.warnings if "solver" in one]
        assert found.iterations < 3000


def test_surface_is_the_displacement_between_and_zero_far_away() -> None:
    found = solve(LAYER, Ball(8.0), Motion(0.6, (0.2, 0)), size_mm=(16, 12), grid=64)
    surface = found.surface()
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    nodes = np.stack([x.ravel(), y.ravel()], axis=1)
    moved = surface(nodes)[:, :2] - nodes
    np.testing.assert_allclose(moved, found.displacement_mm[..., :2].reshape(-1, 2), atol=1e-9)
    far = np.array([[40.0, 0.0], [-9.0, 300.0]])
    np.testing.assert_allclose(surface(far), [[40, 0, 0], [-9, 300, 0]], atol=1e-12)
    line = np.stack([np.linspace(-16, 16, 4001), np.full(4001, 0.7)], axis=1)
    step = np.diff(surface(line), axis=0)[:, 1:]
    assert np.abs(np.diff(step, axis=0)).max() < 2e-4, "no jumps and no kinks, beyond the solved area neither"
    assert surface(np.empty((0, 2))).shape == (0, 3)


@pytest.mark.parametrize(
    ("friction", "motion", "lost"),
    [(0.0, Motion(0.8), 0.005), (0.5, Motion(0.8), 0.005), (1.0, Motion(0.8, twist_deg=30.0), 0.02)],
)
def test_surface_touches_the_object_and_keeps_its_volume(
    friction: float, motion: Motion, lost: float
) -> None:
    """The pressed surface lies on the ball, at the positions of the points in space; the surface around bulges up.

    The solved area ends where some bulge is left: as much as linear theory has there.
    """
    ball = Ball(10.0)
    found = solve(LAYER, ball, motion, friction=friction, size_mm=(44, 44), grid=176)
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    moved = found.surface()(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(*x.shape, 3)
    touching = found.in_contact & (np.hypot(x, y) < 0.9 * np.hypot(x, y)[found.in_contact].max())
    on_ball = ball.height_mm(moved[..., 0], moved[..., 1]) - motion.press_mm
    assert np.abs(moved[..., 2] - on_ball)[touching].max() < 0.003
    step = found.x_mm[1] - found.x_mm[0]
    x_y, x_x = np.gradient(moved[..., 0], step)
    y_y, y_x = np.gradient(moved[..., 1], step)
    volume = moved[..., 2] * (x_x * y_y - x_y * y_x)
    beyond = -found.displacement_mm[..., 2].sum()
    assert abs(volume.sum() + beyond) < lost * -volume[volume < 0].sum()


def test_pattern_at_the_surface_is_the_surface_and_below_it_moves_as_the_layer_does() -> None:
    """The depth changes nothing but where the pattern is; near the support little moves."""
    from dataclasses import replace

    motion = Motion(0.6, (0.3, 0.0))
    at_surface = solve(LAYER, Ball(8.0), motion, size_mm=(16, 12), grid=64)
    np.testing.assert_array_equal(at_surface.marker_displacement_mm, at_surface.displacement_mm)
    largest = []
    for depth in (0.001, 1.0, 3.9):
        found = solve(replace(LAYER, marker_depth_mm=depth), Ball(8.0), motion, size_mm=(16, 12), grid=64)
        np.testing.assert_array_equal(found.displacement_mm, at_surface.displacement_mm)
        np.testing.assert_array_equal(found.traction_mpa, at_surface.traction_mpa)
        largest.append(np.abs(found.marker_displacement_mm).max())
        points = np.array([[0.0, 0.0], [2.0, 1.0]])
        moved = found.marker_layer()(points)
        assert np.abs(moved[:, :2] - points).max() <= largest[-1] * 1.01
        if depth == 0.001:
            np.testing.assert_allclose(found.marker_displacement_mm, at_surface.displacement_mm, atol=0.002)
    assert largest[0] > 1.2 * largest[1] > 20 * largest[2] > 0


def test_sliding_contact_moves_on() -> None:
    """With little friction, a sheared ball presses at its present position, not at its earlier position."""
    slid, there = (
        solve(LAYER, ball, motion, friction=0.02, size_mm=(18, 18), grid=60)
        for ball, motion in (
            (Ball(8.0, centre_mm=(-1.5, 0)), Motion(0.5, (3.0, 0.0))),
            (Ball(8.0, centre_mm=(1.5, 0)), Motion(0.5)),
        )
    )
    x = slid.x_mm[None, :]
    centres = [np.sum(one.traction_mpa[..., 2] * x) / one.traction_mpa[..., 2].sum() for one in (slid, there)]
    assert centres[0] == pytest.approx(centres[1], abs=0.1) and centres[1] == pytest.approx(1.5, abs=0.01)
    assert np.abs(slid.displacement_mm[..., 2] - there.displacement_mm[..., 2]).max() < 0.06


def test_contact_is_found_where_the_surface_bulges_up() -> None:
    """A collar around a punch, too high for the flat surface, is touched by the surface that bulges beside the
    punch.
    """
    axis = 0.1 * (np.arange(141) - 70)
    r = np.hypot(*np.meshgrid(axis, axis))
    for friction in (0.0, 0.5):
        free = solve(
            Elastomer(2.0, 0.3), Punch(3.0), Motion(0.4), friction=friction, size_mm=(20, 20), grid=80
        )
        row, beside = free.displacement_mm[40, :, 2], (free.x_mm > 4.2) & (free.x_mm < 5.8)
        bulge = row[beside].max()
        face = np.where(r <= 3.0, 0.0, np.where((r > 4.0) & (r < 6.0), -0.4 - 0.7 * bulge, np.nan))
        found = solve(
            Elastomer(2.0, 0.3),
            HeightMap(face, 0.1),
            Motion(0.4),
            friction=friction,
            size_mm=(20, 20),
            grid=80,
        )
        assert 0.7 * bulge > 0.16 * 0.4 and found.in_contact[40, beside].any()
        assert found.displacement_mm[40, beside, 2].max() < 0.7 * bulge + 2e-3
