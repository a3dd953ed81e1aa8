"""The README's picture: the pattern, the camera's frame with ids, the displacements."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.frame.plots import png_of, pyplot
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, COLORS

from .sample import Sample, sample

DOTS_PER_INCH = 110
INK, FAINT = "#2b2f36", "#6a7078"
# Left, top, right, bottom of the shown parts of the frame.
IDS_WINDOW_PX = (225, 136, 415, 278.5)
ARROWS_WINDOW_PX = (115, 65, 475, 335)


def figures() -> dict[str, bytes]:
    """File name -> PNG."""
    plt = pyplot()

    shown = sample()
    with plt.rc_context({"font.family": "DejaVu Sans", "text.color": INK}):
        figure, axes = plt.subplots(1, 3, figsize=(13.2, 3.95), dpi=DOTS_PER_INCH)
        figure.subplots_adjust(left=0.005, right=0.995, top=0.865, bottom=0.095, wspace=0.025)
        _pattern(axes[0], shown.layout)
        _ids(axes[1], shown)
        _arrows(axes[2], shown)
        file = png_of(figure)
    return {"overview.png": _quantised(file)}


def _pattern(axes: Any, layout: Layout) -> None:
    from matplotlib.collections import PolyCollection

    axes.fill(*layout.outline_mm.T, color=layout.palette["black"], lw=0)
    for color, name in enumerate(COLORS):
        if color != BLACK:
            cells = layout.marker_xy_mm[layout.cell_corners[layout.cell_color == color]]
            axes.add_collection(PolyCollection(list(cells), facecolor=layout.palette[name], edgecolor="none"))
    width, height = layout.size_mm
    span = 1.06 * height
    axes.set(xlim=(-span * 2 / 3, span * 2 / 3), ylim=(-span / 2, span / 2), aspect="equal")
    axes.axis("off")
    _titles(axes, "the pattern", f"{layout.present.sum()} markers, {width:.1f} × {height:.1f} mm")


def _ids(axes: Any, shown: Sample) -> None:
    left, top, right, bottom = IDS_WINDOW_PX
    axes.imshow(shown.pressed_image[..., ::-1], interpolation="nearest")
    _gridlines(axes, shown, "#ffffff", 0.5)
    inside = np.all(
        (shown.pressed.xy_px > (left + 3, top + 9)) & (shown.pressed.xy_px < (right - 9, bottom - 3)), axis=1
    )
    for marker in np.flatnonzero(inside):
        x, y = shown.pressed.xy_px[marker]
        axes.plot(x, y, "o", ms=3.2, mfc="#fff04d", mec="black", mew=0.5)
        label = axes.text(x + 1.1, y - 1.3, str(marker), fontsize=6.8, color="white", weight="bold")
        label.set_path_effects(_outline())
    axes.set(xlim=(left, right), ylim=(bottom, top))
    axes.axis("off")
    _titles(axes, "what the camera sees, numbered", "part of a 640 × 480 frame under contact")


def _arrows(axes: Any, shown: Sample) -> None:
    rest, moved = shown.rest.xy_px, shown.pressed.xy_px - shown.rest.xy_px
    length = np.hypot(*moved.T)
    gray = shown.pressed_image.mean(axis=2)
    axes.imshow(22 + 0.22 * gray, cmap="gray", vmin=0, vmax=255)
    arrows = axes.quiver(
        *rest.T, *moved.T, length, angles="xy", scale_units="xy", scale=1, cmap="turbo", width=0.0052,
        headwidth=3.2, headlength=3.6, headaxislength=3.2, minlength=0.3,
    )  # fmt: skip
    arrows.set_clim(0, float(np.nanmax(length)))
    left, top, right, bottom = ARROWS_WINDOW_PX
    axes.set(xlim=(left, right), ylim=(bottom, top))
    axes.axis("off")
    found = int(np.isfinite(length).sum())
    _titles(
        axes,
        "how far every marker moved",
        f"{found} displacements, up to {np.nanmax(length):.1f} px, to scale",
    )


def _gridlines(axes: Any, shown: Sample, color: str, width: float) -> None:
    from matplotlib.collections import LineCollection

    lines = shown.pressed.xy_px[shown.reference.edges]
    axes.add_collection(LineCollection(list(lines), colors=color, linewidths=width, alpha=0.8))


def _titles(axes: Any, title: str, note: str) -> None:
    axes.set_title(title, fontsize=12.5, weight="bold", color=INK, pad=9)
    axes.text(0.5, -0.045, note, transform=axes.transAxes, ha="center", va="top", fontsize=8.8, color=FAINT)


def _outline() -> list[Any]:
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=1.6, foreground="black")]


def _quantised(png: bytes) -> bytes:
    """Colors in steps of 4, which are invisible and compress better as PNG."""
    import cv2

    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    stepped = np.where(image > 250, 255, image // 4 * 4 + 2).astype(np.uint8)
    return bytes(cv2.imencode(".png", stepped, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1])
