"""Plots with matplotlib: a layout, the markers of a picture, a recording. Each draws into axes and returns these."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cmpdesign.api.layouts import read_layout
from cmpdesign.errors import CmpDesignError
from cmpdesign.libraries import extra
from cmpdesign.patterns.colors import BLACK, COLORS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.api.layouts import AnyLayout
    from cmpdesign.tracking.export.runs import Run
    from extractor import Markers

# Colors of the statuses lost, measured, repaired, fitted.
_STATUS_COLORS = ("none", "#00e5ff", "#ffb300", "#ff4081")


def plot_layout(layout: AnyLayout, ax: Any = None, *, ids: bool = False) -> Any:
    """Draw a pattern in mm, as seen from the front.

    Args:
        layout: a layout, the path of a layout file, a ``Reference``, or the JSON object of a layout file.
        ax: matplotlib axes; None: new ones.
        ids: write every marker's id.

    Returns:
        The axes.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    with extra("evaluate"):
        from matplotlib.collections import PolyCollection

    axes, pattern = _axes(ax), read_layout(layout)
    outline = PolyCollection([pattern.outline_mm], facecolors=[pattern.palette[COLORS[BLACK]]])
    colors = [pattern.palette[COLORS[color]] for color in pattern.cell_color[pattern.colored_cells].tolist()]
    axes.add_collection(outline)
    axes.add_collection(PolyCollection(list(pattern.colored_outlines_mm), facecolors=colors))
    for marker in pattern.present.nonzero()[0].tolist() if ids else ():
        axes.text(
            *pattern.marker_xy_mm[marker], str(marker), color="white", fontsize=5, ha="center", va="center"
        )
    axes.set(aspect="equal", xlabel="x in mm", ylabel="y in mm")
    axes.autoscale_view()
    return axes


def plot_markers(image: NDArray[Any], markers: Markers, ax: Any = None) -> Any:
    """Draw the markers over a picture: measured, repaired and fitted markers in different colors.

    Args:
        image: (H, W, 3) BGR, uint8 or uint16.
        markers: the result of ``Extractor.extract`` for the picture.
        ax: matplotlib axes; None: new ones.

    Returns:
        The axes, in px, y down.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    import numpy as np

    axes = _axes(ax)
    shown = np.asarray(image)[..., ::-1]
    axes.imshow(shown if shown.dtype == np.uint8 else (shown >> 8).astype(np.uint8))
    for status, (name, count) in zip((1, 2, 3), list(markers.counts.items())[:3], strict=True):
        x, y = markers.xy_px[markers.status == status].T
        if count:
            axes.scatter(x, y, s=6, color=_STATUS_COLORS[status], label=f"{count} {name}")
    if markers.found:
        axes.legend(loc="lower right")
    axes.set(xlabel="x in px", ylabel="y in px")
    return axes


def plot_displacement(run: Run, frame: int = -1, ax: Any = None, *, magnified: float = 1.0) -> Any:
    """Draw the displacements of one frame of a recording as arrows from the places at rest, in mm.

    Args:
        run: the result of ``load_run``.
        frame: its place in the run; -1: the last frame.
        ax: matplotlib axes; None: new ones.
        magnified: factor of the arrows' length.

    Returns:
        The axes.

    Raises:
        CmpDesignError: no such frame.
        MissingLibraryError: matplotlib is not installed.
    """
    if not -len(run) <= frame < len(run):
        raise CmpDesignError(f"frame is {frame}; the run has the frames 0 to {len(run) - 1}")
    axes = _axes(ax)
    moved = run.arrays["displacement_mm"][frame]
    rest = run.arrays["position_mm"][frame] - moved
    arrows = axes.quiver(
        *rest[:, :2].T,
        *(magnified * moved[:, :2]).T,
        (moved**2).sum(axis=1) ** 0.5,
        angles="xy",
        scale_units="xy",
        scale=1,
    )
    axes.figure.colorbar(arrows, ax=axes, label="displacement in mm")
    axes.set(aspect="equal", xlabel="x in mm", ylabel="y in mm")
    axes.margins(0.1)
    return axes


def plot_history(run: Run, markers: list[int] | None = None, ax: Any = None) -> Any:
    """Draw the markers' displacements over time.

    Args:
        run: the result of ``load_run``.
        markers: ids; None: median and largest displacement of all markers.
        ax: matplotlib axes; None: new ones.

    Returns:
        The axes: mm over s.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    import numpy as np

    axes, time_s = _axes(ax), run.arrays["time_s"]
    length_mm = np.linalg.norm(run.arrays["displacement_mm"], axis=2)
    for marker in markers or ():
        axes.plot(time_s, length_mm[:, marker], label=f"marker {marker}")
    if markers is None:
        known = np.isfinite(length_mm).any(axis=1)
        axes.plot(time_s[known], np.nanmedian(length_mm[known], axis=1), label="median")
        axes.plot(time_s[known], np.nanmax(length_mm[known], axis=1), label="largest")
    axes.set(xlabel="time in s", ylabel="displacement in mm")
    axes.legend()
    return axes


def _axes(ax: Any) -> Any:
    with extra("evaluate"):
        from matplotlib import pyplot

    return pyplot.subplots()[1] if ax is None else ax
