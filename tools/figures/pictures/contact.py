"""The picture of docs/explanation/contact.md: a ball pressed and sheared; pressure, section, stick and slip."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.frame.plots import png_of, pyplot
from cmpdesign.contact import Ball, Contact, Elastomer, Motion, solve

DOTS_PER_INCH = 110
INK, FAINT, ACCENT = "#2b2f36", "#6a7078", "#c8322d"
ELASTOMER, BALL = Elastomer(4.0, 0.3), Ball(10.0)
MOTIONS = (Motion(1.0), Motion(1.0, (0.6, 0.0)))
SIZE_MM, GRID, SHOWN_MM = (24.0, 24.0), 120, 8.0


def figures() -> dict[str, bytes]:
    """File name -> PNG."""
    plt = pyplot()

    pressed, sheared = (
        solve(ELASTOMER, BALL, motion, friction=0.5, size_mm=SIZE_MM, grid=GRID) for motion in MOTIONS
    )
    with plt.rc_context({"font.family": "DejaVu Sans", "text.color": INK, "font.size": 9}):
        figure, axes = plt.subplots(
            1, 3, figsize=(13.2, 4.1), dpi=DOTS_PER_INCH, gridspec_kw={"width_ratios": (1.13, 1.5, 1)}
        )
        figure.subplots_adjust(left=0.035, right=0.993, top=0.9, bottom=0.11, wspace=0.2)
        _pressure(axes[0], pressed)
        _section(axes[1], pressed)
        _slip(axes[2], sheared)
        file = png_of(figure)
    return {"contact.png": file}


def _pressure(axes: Any, contact: Contact) -> None:
    pressure = np.where(contact.in_contact, -1e3 * contact.traction_mpa[..., 2], np.nan)
    shown = axes.pcolormesh(contact.x_mm, contact.y_mm, pressure, cmap="YlOrRd", vmin=0, rasterized=True)
    axes.figure.colorbar(shown, ax=axes, fraction=0.046, pad=0.03).ax.set_title("kPa", fontsize=9)
    _arrows(axes, contact, 3)
    _framed(axes, "pressure after 1 mm; arrows 3 times to scale")


def _section(axes: Any, contact: Contact) -> None:
    """The surface along y = 0, to scale, with points that were evenly spaced."""
    x = np.linspace(-SHOWN_MM, SHOWN_MM, 400)
    line = contact.surface()(np.stack([x, 0 * x], axis=1))
    support = -ELASTOMER.thickness_mm
    axes.fill_between(line[:, 0], line[:, 2], support, color="#dfe6ee", lw=0)
    axes.plot(line[:, 0], line[:, 2], color=INK, lw=1.6)
    marks = contact.surface()(np.stack([np.arange(-7.5, 7.6, 1.5), np.zeros(11)], axis=1))
    axes.plot(marks[:, 0], marks[:, 2], "o", color=ACCENT, ms=4.5, zorder=3)
    axes.plot(np.arange(-7.5, 7.6, 1.5), np.zeros(11), "|", color=FAINT, ms=7)
    axes.axhline(0, color=FAINT, lw=0.8, ls=(0, (5, 4)), zorder=0)
    angle = np.linspace(-0.9, 0.9, 200)
    radius, lowest = BALL.radius_mm, -MOTIONS[0].press_mm
    axes.plot(radius * np.sin(angle), lowest + radius * (1 - np.cos(angle)), color=FAINT, lw=1.4)
    axes.fill_between([-SHOWN_MM, SHOWN_MM], support, support - 0.5, color="#8d97a3", lw=0)
    axes.text(0, support - 0.27, "rigid support", ha="center", va="center", color="white", fontsize=8)
    axes.set(
        xlim=(-SHOWN_MM, SHOWN_MM), ylim=(support - 0.5, 2.2), aspect="equal", xlabel="x, mm", ylabel="z, mm"
    )
    axes.set_title("section to scale: dots were at the ticks", fontsize=10, color=INK)


def _slip(axes: Any, contact: Contact) -> None:
    from matplotlib.colors import ListedColormap

    state = contact.in_contact.astype(int) + contact.slipping
    axes.pcolormesh(
        contact.x_mm, contact.y_mm, state, cmap=ListedColormap(["#ffffff", "#9ec5a8", "#f2b880"]), vmin=0, vmax=2,
        rasterized=True,
    )  # fmt: skip
    _arrows(axes, contact, 1)
    _framed(axes, "then sheared by 0.6 mm: green sticks")


def _arrows(axes: Any, contact: Contact, times: float) -> None:
    """In-plane displacement, enlarged ``times``."""
    every = (slice(2, None, 6), slice(2, None, 6))
    x, y = np.meshgrid(contact.x_mm, contact.y_mm)
    axes.quiver(
        x[every], y[every], contact.displacement_mm[(*every, 0)], contact.displacement_mm[(*every, 1)],
        angles="xy", scale_units="xy", scale=1 / times, color=INK, width=0.005, headwidth=3.6, minlength=0.4,
    )  # fmt: skip


def _framed(axes: Any, title: str) -> None:
    axes.set(
        xlim=(-SHOWN_MM, SHOWN_MM), ylim=(-SHOWN_MM, SHOWN_MM), aspect="equal", xlabel="x, mm", ylabel="y, mm"
    )
    axes.set_title(title, fontsize=10, color=INK)
