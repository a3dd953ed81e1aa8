"""A step by synthesis: the pattern is drawn, and read against the image; again only around markers that still move.

One step is nearly all that can be had. Where a marker stepped far, its gridlines were not where they were read, and
what they said holds no longer: these cells are taken out of the drawing, drawn anew, and their gridlines are read once
more. All other votes stay valid, for where they were read.
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .bending import hidden_misfit
from .engine import compiled
from .fit import Fit
from .gridlines import KNOWN, LENGTH
from .levels import Levels, black_at, cell_means, level_change, rebled, smooth_levels
from .offsets import Reading, foot_of
from .painting import Strokes, draw_cells, erase_cells, room_for_strokes
from .presets import Steps
from .sight import Frame, Sight
from .step import Judged, heard, lines_of, loose_ones, placed, roughened, solved
from .stepping import box_of, middles, trust, votes, widening
from .synthesis import clear, edge_contrasts, read_gridlines
from .topology import Topology

MIN_SIGMA_PX = 0.4  # blur and pixel; the bare pixel has 0.29
MARGIN_SIGMA = 4.0
MAX_WIDEN = 0.3  # of the blur, in one step
SAME_BLUR = 0.02  # of the blur, by which it may be wrong in a drawing that is kept
SAME_LEVELS = 0.006  # likewise, of the levels. Both may be wrong by more where markers are by that:
NOISY_BLUR, NOISY_LEVELS = 0.5, 0.12  # of how far noise moves these, in units of the blur
NEAR_BLUR = 0.06  # of an edge; what is more blurred answers less simply to a shift
SMALL_BLUR = 0.12  # of an edge; beyond that, blur, levels and places settle together;
BENT = 0.02  # of an edge, and where gridlines are bent by more,
MANY_BENT = 0.25  # of them, each step bends others. Then
HARD_EFFORT = 3.0  # times the effort is allowed
LEFT, MOST_LEFT = 1.0, 0.5  # of a step, per blur, that another step would still correct; and at most
USUAL_EDGE_PX = 10.0
# Wide blur and low levels look alike: what a step sees of a change of blur is less than that by as much as it exceeds
# UNMIXED of an edge, times MIXED (rendered patterns), and at most by
MIXED, UNMIXED, MOST_MIXED = 7.2, 0.065, 0.8
MAX_STEPS = 10
MAX_AGAIN = 0.4  # of the markers may be drawn anew; for more, everything is
JUDGED_BY_PIXELS = Judged(3, 8, 0.0)
NO_ROOM = np.empty((0, 4))


class Drawing(NamedTuple):
    """The pattern as it is drawn, and what was read along its gridlines.

    Attributes:
        xy, lines, bend: where: the markers (M, 2), gridlines (E, 8) and their bending (E, 2).
        contrasts, black: (E, 3) across the gridlines, and under their middles.
        levels, bettered: as drawn, and as the cells' middles then said.
        sums: (E, 24), as ``read_gridlines`` gives them.
        box: of the image that is drawn. sigma: the blur. edge_px: a usual edge's length in it.
    """

    xy: NDArray[np.float64]
    lines: NDArray[np.float64]
    bend: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    black: NDArray[np.float64]
    levels: Levels
    bettered: Levels
    sums: NDArray[np.float64]
    box: NDArray[np.int64]
    sigma: float
    edge_px: float


class Draughtsman:
    """Takes steps by synthesis; the picture it draws is kept from image to image, one a thread."""

    def __init__(self, mesh: Topology) -> None:
        self._mesh = mesh
        self._kept = threading.local()

    def picture(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """The pattern over black as it was last drawn in an image of this shape."""
        kept: Any = getattr(self._kept, "picture", None)
        if kept is None or kept.shape != shape:
            kept = self._kept.picture = np.zeros(shape, np.float32)
        return kept  # type: ignore[no-any-return]

    def _strokes(self) -> Strokes:
        """Those of that picture."""
        kept: Strokes | None = getattr(self._kept, "strokes", None)
        if kept is None:
            kept = self._kept.strokes = room_for_strokes(len(self._mesh.cells))
        return kept

    def steps(self, view: Sight, fit: Fit, steps: Steps, edge_px: float) -> Fit:
        """The fit after as many steps as it takes, or as a preset allows; ``edge_px`` is a short edge in the view."""
        fit, drawing = self._first(view, roughened(self._mesh, fit))
        size = drawing.edge_px
        spent, wide = _effort(size), drawing.sigma > SMALL_BLUR * edge_px
        for step in range(MAX_STEPS - 1):
            near = steps.near * min(drawing.sigma, (NEAR_BLUR * edge_px) ** 2 / drawing.sigma)
            about = fit.measured, drawing.xy, fit.strides
            hard = wide or bent_share(fit.bend, BENT * edge_px) > MANY_BENT
            few = 0.0 if hard else steps.few
            anew, moving = still_moving(*about, near, steps.enough, few, self._mesh.edges)
            everything = _looks_other(fit, drawing, steps.enough) or moving > MAX_AGAIN * len(anew)
            spent += _effort(size, None if everything else moving / len(anew))
            allowed = steps.effort * (HARD_EFFORT if hard else 1.0)
            if not (everything or moving) or (step > 0 and spent > allowed):
                break
            fit = roughened(self._mesh, placed(self._mesh, fit))
            if everything:
                fit, drawing = self._first(view, fit)
            else:
                fit, drawing = self._again(view, fit, drawing, anew)
        return fit._replace(unsettled=unsettled(fit.measured - drawing.xy, drawing.sigma))

    def _first(self, view: Sight, fit: Fit) -> tuple[Fit, Drawing]:
        """A step from everything."""
        image, mesh, levels, sigma = view.image, self._mesh, fit.levels, fit.sigma
        box = box_of(fit.xy, MARGIN_SIGMA * sigma + 2, image.shape[1], image.shape[0])
        lines, picture = lines_of(mesh, fit), self.picture(image.shape)
        contrasts = edge_contrasts(lines, fit.xy, mesh.cells, mesh.edge_cells, levels.cell, levels.slope)
        clear(picture, box)
        strokes = self._strokes()
        strokes.used[:] = 0
        sides = mesh.cells, mesh.cell_edges, mesh.edges, lines
        how = levels.cell, levels.slope, sigma, box, picture, strokes
        draw_cells(np.ones(len(mesh.cells), np.bool_), 1.0, fit.xy, *sides, *how)
        black = black_at(levels.black, middles(lines), *view.frame)
        sums = read_gridlines(image, picture, lines, contrasts, black, sigma, box, loose_ones(mesh, fit))
        bettered = self._bettered(view, picture, fit)
        about = levels, bettered, sums, box, sigma, usual_length(lines)
        drawing = Drawing(fit.xy, lines, fit.bend, contrasts, black, *about)
        return self._stepped(view.frame, fit._replace(levels=bettered), drawing), drawing

    def _again(self, view: Sight, fit: Fit, drawing: Drawing, anew: NDArray[np.bool_]) -> tuple[Fit, Drawing]:
        """A step from what was read, once more where gridlines end at markers that are ``anew`` (M,) bool."""
        image, mesh, levels, sigma = view.image, self._mesh, drawing.levels, drawing.sigma
        picture, box = self.picture(image.shape), drawing.box
        again, which = touching(anew, mesh.edges), touching(anew, mesh.cells)
        xy, bend = chosen(anew, fit.xy, drawing.xy), chosen(again, fit.bend, drawing.bend)
        fit = fit._replace(xy=xy, bend=bend)
        lines = chosen(again, lines_of(mesh, fit), drawing.lines)
        contrasts = edge_contrasts(lines, xy, mesh.cells, mesh.edge_cells, levels.cell, levels.slope)
        sides = mesh.cells, mesh.cell_edges, mesh.edges
        how = levels.cell, levels.slope, sigma, box, picture, self._strokes()
        erase_cells(which, drawing.xy, *sides, drawing.lines, *how)
        draw_cells(which, 1.0, xy, *sides, lines, *how)
        black = black_at(levels.black, middles(lines), *view.frame)
        some = lines.copy()
        some[~again, KNOWN] = 0.0
        sums = read_gridlines(image, picture, some, contrasts, black, sigma, box, loose_ones(mesh, fit))
        drawing = drawing._replace(
            xy=xy,
            lines=lines,
            bend=bend,
            contrasts=chosen(again, contrasts, drawing.contrasts),
            black=chosen(again, black, drawing.black),
            sums=chosen(again, sums, drawing.sums),
        )
        return self._stepped(view.frame, fit, drawing), drawing

    def _stepped(self, frame: Frame, fit: Fit, drawing: Drawing) -> Fit:
        """The fit after the step that what was read asks for."""
        mesh, levels, bettered = self._mesh, drawing.levels, drawing.bettered
        lines, contrasts, sigma = drawing.lines, drawing.contrasts, drawing.sigma
        sums = drawing.sums.copy()
        changes = bettered.cell - levels.cell, bettered.black - levels.black
        said = votes(sums, contrasts, mesh.edge_cells, *changes, middles(lines), *frame)
        fit, told = heard(mesh, fit._replace(sigma=sigma), lines, sums, said, JUDGED_BY_PIXELS)
        pardon = hidden_misfit(fit.loose, contrasts, sigma)
        use, noise = trust(sums, told.to_a, told.to_b, pardon, *JUDGED_BY_PIXELS)
        fit = fit._replace(noise=float(noise) if np.isfinite(noise) else fit.noise)
        foot = foot_of(contrasts, drawing.black, said[2])
        fit = solved(mesh, fit, told, use, lines, contrasts, True)
        reading = Reading(lines, contrasts, foot, NO_ROOM, use, sigma, fit.noise, True)
        wider = self._widened(fit.xy, drawing, sums, use)
        if max(wider, sigma) > UNMIXED * drawing.edge_px:
            bettered = rebled(bettered, fit.xy, mesh, sigma, wider)
        return fit._replace(sigma=wider, levels=bettered, reading=reading)

    def _widened(
        self, xy: NDArray[np.float64], drawing: Drawing, sums: NDArray[np.float64], use: NDArray[np.float64]
    ) -> float:
        """The blur that the gridlines say, px."""
        mesh, lines, bettered, sigma = self._mesh, drawing.lines, drawing.bettered, drawing.sigma
        now = edge_contrasts(lines, xy, mesh.cells, mesh.edge_cells, bettered.cell, bettered.slope)
        wider = widening(sums, use, drawing.contrasts, now, sigma)
        wider /= 1.0 - min(max(MIXED * (sigma / drawing.edge_px - UNMIXED), 0.0), MOST_MIXED)
        return max(sigma + float(np.clip(wider, -MAX_WIDEN * sigma, MAX_WIDEN * sigma)), MIN_SIGMA_PX)

    def _bettered(self, view: Sight, picture: NDArray[np.float32], fit: Fit) -> Levels:
        """Levels corrected by what the drawing does not explain in the middle of the cells."""
        mesh = self._mesh
        drawn = cell_means(view.image, picture, fit.xy, mesh.cells, 0.0)
        black = cell_means(view.image, picture, fit.xy, mesh.black, 0.0)
        drawn[:, :3] += fit.levels.cell
        return smooth_levels(drawn, black, fit.xy, mesh, fit.noise, view.frame)


def _effort(size_px: float, share: float | None = None) -> float:
    """What a step costs, 1 for everything with edges of ``USUAL_EDGE_PX``: from everything, or around a share of it."""
    pixels = min((size_px / USUAL_EDGE_PX) ** 2, 4.0)
    return 0.45 + 0.55 * pixels if share is None else 0.35 + 0.6 * share * pixels


def _looks_other(fit: Fit, drawing: Drawing, enough: float) -> bool:
    """Whether the blur or the levels were found to be others than those drawn, by more than what noise of ``enough``
    standard deviations of a marker makes of them."""
    blur = abs(fit.sigma - drawing.sigma) / drawing.sigma
    levels = level_change(drawing.levels.cell, fit.levels.cell)
    if blur < SAME_BLUR and levels < SAME_LEVELS:
        return False
    noise = enough * usual_deviation(fit.information.diagonal) / drawing.sigma
    return bool(blur > max(SAME_BLUR, NOISY_BLUR * noise) or levels > max(SAME_LEVELS, NOISY_LEVELS * noise))


@compiled
def still_moving(measured, drawn, strides, near, enough, few, edges):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers that are more than ``near`` px and ``enough`` deviations from where they are drawn, and
    those beside them; and how many these are. None where no more than ``few`` (a share of all) move."""
    count = drawn.shape[0]
    moving, found = np.zeros(count, np.bool_), 0
    for m in range(count):
        dx, dy = measured[m, 0] - drawn[m, 0], measured[m, 1] - drawn[m, 1]
        moving[m] = dx * dx + dy * dy > near * near and strides[m] > enough
        found += moving[m]
    if found <= few * count:
        return np.zeros(count, np.bool_), 0
    out = moving.copy()
    beside(moving, edges, out)
    return out, np.sum(out)


@compiled
def usual_length(lines):  # type: ignore[no-untyped-def]
    """The median length of the known gridlines (E, 8), px; 1 without any."""
    known = lines[lines[:, KNOWN] > 0.0, LENGTH]
    return np.median(known) if known.shape[0] > 0 else 1.0


@compiled
def usual_deviation(diagonal):  # type: ignore[no-untyped-def]
    """The markers' median standard deviation, px, by their blocks of the information (M, 3), all others known."""
    return np.sqrt(2.0 / np.median(diagonal[:, 0] + diagonal[:, 2]))


@compiled
def bent_share(bend, limit):  # type: ignore[no-untyped-def]
    """The share of gridlines that bend (E, 2) by more than a limit, px."""
    many = 0
    for e in range(bend.shape[0]):
        many += max(abs(bend[e, 0]), abs(bend[e, 1])) > limit
    return many / bend.shape[0]


@compiled
def unsettled(shift, sigma):  # type: ignore[no-untyped-def]
    """(M, 2, 2) px^2, what the last step may have left of a ``shift`` (M, 2) from where the markers are drawn: the
    drawing answers to shifts of the size of the blur as it would to smaller ones."""
    out = np.zeros((shift.shape[0], 2, 2))
    for m in range(shift.shape[0]):
        x, y = shift[m, 0], shift[m, 1]
        share = min(LEFT * np.hypot(x, y) / sigma, MOST_LEFT)
        out[m, 0, 0], out[m, 1, 1] = (share * x) ** 2, (share * y) ** 2
        out[m, 0, 1] = out[m, 1, 0] = share * share * x * y
    return out


@compiled
def beside(which, edges, out):  # type: ignore[no-untyped-def]
    """Add to ``out`` (M,) the markers with a gridline to one of ``which`` (M,)."""
    for e in range(edges.shape[0]):
        a, b = edges[e, 0], edges[e, 1]
        out[a] |= which[b]
        out[b] |= which[a]


@compiled
def touching(which, groups):  # type: ignore[no-untyped-def]
    """(G,) bool, the groups (G, n) of markers with one of ``which`` (M,) among them."""
    out = np.zeros(groups.shape[0], np.bool_)
    for g in range(groups.shape[0]):
        for k in range(groups.shape[1]):
            out[g] |= which[groups[g, k]]
    return out


@compiled
def chosen(which, ones, others):  # type: ignore[no-untyped-def]
    """Rows of ``ones`` where ``which``, of ``others`` elsewhere."""
    out = others.copy()
    for i in range(which.shape[0]):
        if which[i]:
            out[i] = ones[i]
    return out
