"""The result of a contact: fields on the surface, forces, and the deformed surface."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.grid import ContactGrid
from cmpdesign.libraries import extra

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Contact:
    """A solved contact, in the layout frame. Row i of every field is at ``y_mm[i]``, column j at ``x_mm[j]``.

    Attributes:
        x_mm, y_mm: the cells' centres, (nx,) and (ny,).
        displacement_mm: displacement of the surface's points, (ny, nx, 3).
        press_displacement_mm: the part of the displacement in x and y by the press, without shear and twist, (ny, nx,
            2).
        marker_displacement_mm: displacement of the points of the pattern, (ny, nx, 3); without a marker depth the
            surface's.
        marker_press_displacement_mm: the part by the press, (ny, nx, 2).
        traction_mpa: traction of the object on the surface, (ny, nx, 3); z is minus the pressure.
        in_contact: (ny, nx) bool.
        slipping: in contact and at the friction limit, (ny, nx) bool.
        force_n: force of the object on the elastic layer, (3,); z is negative.
        moment_nmm: moment of the tractions about the object's centre at the height of the surface, (3,).
        largest_strain: the larger of the largest principal strain of the surface and depth over thickness.
        warnings: reasons to doubt the result, each with value, limit and remedy.
        iterations: how often the elastic layer's response was computed.
        residual_mm: root mean square of the remaining gap in the contact.
        thickness_mm: thickness of the elastic layer.
    """

    x_mm: Array
    y_mm: Array
    displacement_mm: Array = field(repr=False)
    press_displacement_mm: Array = field(repr=False)
    marker_displacement_mm: Array = field(repr=False)
    marker_press_displacement_mm: Array = field(repr=False)
    traction_mpa: Array = field(repr=False)
    in_contact: Mask = field(repr=False)
    slipping: Mask = field(repr=False)
    force_n: Array
    moment_nmm: Array
    largest_strain: float
    warnings: tuple[str, ...]
    iterations: int
    residual_mm: float
    thickness_mm: float

    def surface(self) -> Relief:
        """The touched surface as a smooth function of the layout frame."""
        return make_relief(self, self.displacement_mm, self.press_displacement_mm)

    def marker_layer(self) -> Relief:
        """The pattern as a smooth function of the layout frame, whose z is 0 at the pattern at rest."""
        return make_relief(self, self.marker_displacement_mm, self.marker_press_displacement_mm)


@dataclass(frozen=True, eq=False)
class Relief:
    """A deformed surface or pattern: maps (N, 2) mm of the flat surface to (N, 3) mm, by bicubic splines of
    displacements.

    The solver reads the object's height at the place of a point, so z is a height over this place. Therefore z is read
    at the moved place of a point: the surface touches the object, and no volume is lost. Read at the point's
    place at rest, z is of first order only; a press by a ball then seems to lose a tenth of the dent's volume and more.

    Beyond the solved area the displacement falls smoothly to zero within one thickness (at least 6 cells).

    Attributes:
        grid: the cells of the coefficients.
        coefficients: (5, ny, nx) of the displacement in x, y and z, and of the press's part in x and y.
    """

    grid: ContactGrid
    coefficients: Array = field(repr=False)

    def __call__(self, xy_mm: Array, /) -> Array:
        """(N, 3) mm: deformed positions of the points (N, 2) mm of the flat surface."""
        xy = np.asarray(xy_mm, dtype=np.float64)
        x, y, by_press_x, by_press_y = (self._displacement(part, xy) for part in (0, 1, 3, 4))
        z = self._displacement(2, xy + np.stack([by_press_x, by_press_y], axis=1))
        return np.stack([xy[:, 0] + x, xy[:, 1] + y, z], axis=1)

    def _displacement(self, part: int, xy_mm: Array) -> Array:
        """(N,) mm: one of the splines at points (N, 2) mm."""
        with extra("evaluate"):
            from scipy.ndimage import map_coordinates

        column = (xy_mm[:, 0] - self.grid.x_mm[0]) / self.grid.step_mm
        row = (xy_mm[:, 1] - self.grid.y_mm[0]) / self.grid.step_mm
        return np.asarray(
            map_coordinates(
                self.coefficients[part], np.stack([row, column]), order=3, mode="constant", prefilter=False
            )
        )


def make_relief(contact: Contact, displacement_mm: Array, by_press_mm: Array) -> Relief:
    """The splines of a contact's displacement (ny, nx, 3) and of the press's part (ny, nx, 2) of it."""
    with extra("evaluate"):
        from scipy.ndimage import spline_filter

    step = float(contact.x_mm[1] - contact.x_mm[0])
    margin = max(6, int(np.ceil(contact.thickness_mm / step)))
    margin = min(margin, max(contact.in_contact.shape))
    # Four cells of zeros at the rim, so that the spline ends smoothly.
    ramp = np.concatenate([np.zeros(4), 0.5 - 0.5 * np.cos(np.pi * np.arange(1, margin + 1) / (margin + 1))])
    rim_cells = len(ramp)
    ny, nx = contact.in_contact.shape
    fade = np.outer(*(np.concatenate([ramp, np.ones(n), ramp[::-1]]) for n in (ny, nx)))
    parts = np.concatenate([displacement_mm, by_press_mm], axis=2)
    padded = [np.pad(parts[..., part], rim_cells, mode="edge") * fade for part in range(parts.shape[2])]
    outside_mm = step * (np.arange(rim_cells) + 1)
    grid = ContactGrid(
        np.concatenate([contact.x_mm[0] - outside_mm[::-1], contact.x_mm, contact.x_mm[-1] + outside_mm]),
        np.concatenate([contact.y_mm[0] - outside_mm[::-1], contact.y_mm, contact.y_mm[-1] + outside_mm]),
        step,
    )
    return Relief(grid, np.stack([spline_filter(values, order=3, mode="mirror") for values in padded]))
