"""A step by synthesis: the pattern is drawn, and read against the image; again only around markers that still move.

One step is nearly all that can be had. Where a marker stepped far, its gridlines were not where they were read, and
what they said holds no longer: these cells are taken out of the drawing, drawn anew, and their gridlines are read once
more. All other votes stay valid, for where they were read.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from .bending import hidden_misfit
from .drawn import Board, Drawing, drawn, drawn_again, room_for
from .engine import compiled
from .fit import Fit
from .levels import level_change, rebled
from .offsets import Reading, foot_of
from .presets import Steps
from .sight import Frame, Sight
from .step import Judged, listened, moved_on, placed, roughened, solution
from .stepping import middles, trust, votes, widening
from .synthesis import edge_contrasts
from .topology import Topology

MIN_SIGMA_PX = 0.4  # blur and pixel; the bare pixel has 0.29
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


class Draughtsman:
    """Takes steps by synthesis; the picture it draws is kept from image to image, one a thread."""

    def __init__(self, mesh: Topology) -> None:
        self._mesh = mesh
        self._kept = threading.local()

    def board(self, shape: tuple[int, ...]) -> Board:
        """With the pattern over black as it was last drawn in an image of this shape."""
        kept: Board | None = getattr(self._kept, "board", None)
        if kept is None or kept.picture.shape != shape:
            kept = self._kept.board = room_for(shape, self._mesh)
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
        drawing = drawn(view, self._mesh, fit, self.board(view.image.shape))
        return self._stepped(view.frame, fit, drawing), drawing

    def _again(self, view: Sight, fit: Fit, drawing: Drawing, anew: NDArray[np.bool_]) -> tuple[Fit, Drawing]:
        """A step from what was read, once more where gridlines end at markers that are ``anew`` (M,) bool."""
        drawing = drawn_again(view, self._mesh, fit, drawing, anew, self.board(view.image.shape))
        return self._stepped(view.frame, fit._replace(xy=drawing.xy, bend=drawing.bend), drawing), drawing

    def _stepped(self, frame: Frame, fit: Fit, drawing: Drawing) -> Fit:
        """The fit after the step that what was read asks for."""
        mesh, levels, bettered = self._mesh, drawing.levels, drawing.bettered
        assert fit.reading is not None
        changes = bettered.cell - levels.cell, bettered.black - levels.black
        now = fit.xy, fit.beyond, fit.rough, drawing.bend, fit.reading.use, fit.noise
        seen = drawing.lines, drawing.contrasts, drawing.black, drawing.sums, drawing.sigma
        tables = mesh.edges, mesh.spokes, mesh.edge_cells
        sums, use, loose, foot, noise, *step = _step(seen, changes, now, tables, tuple(frame))
        reading = Reading(drawing.lines, drawing.contrasts, foot, NO_ROOM, use, drawing.sigma, noise, True)
        fit = moved_on(fit, step, loose=loose, reading=reading, noise=noise)
        wider = self._widened(fit.xy, drawing, sums, use)
        if max(wider, drawing.sigma) > UNMIXED * drawing.edge_px:
            bettered = rebled(bettered, fit.xy, mesh, drawing.sigma, wider)
        return fit._replace(sigma=wider, levels=bettered)

    def _widened(
        self, xy: NDArray[np.float64], drawing: Drawing, sums: NDArray[np.float64], use: NDArray[np.float64]
    ) -> float:
        """The blur that the gridlines say, px."""
        mesh, lines, bettered, sigma = self._mesh, drawing.lines, drawing.bettered, drawing.sigma
        now = edge_contrasts(lines, xy, mesh.cells, mesh.edge_cells, bettered.cell, bettered.slope)
        wider = widening(sums, use, drawing.contrasts, now, sigma)
        wider /= 1.0 - min(max(MIXED * (sigma / drawing.edge_px - UNMIXED), 0.0), MOST_MIXED)
        return max(sigma + float(np.clip(wider, -MAX_WIDEN * sigma, MAX_WIDEN * sigma)), MIN_SIGMA_PX)


@compiled
def _step(seen, changes, now, tables, frame):  # type: ignore[no-untyped-def]
    """Sums without bending, use, looseness, foot and noise of what was ``seen``, and the solution.

    Args:
        seen: lines, contrasts, black, sums and blur of a drawing.
        changes: of the cells' levels (K, 3) and of the black's polynomial (3, 10) since.
    """
    lines, contrasts, black, read, sigma = seen
    xy, beyond, rough, bend, before, noise = now
    edges, spokes, edge_cells = tables
    values, least, unjudged = JUDGED_BY_PIXELS
    sums = read.copy()
    cell_change, black_change = changes
    to_a, to_b, off = votes(sums, contrasts, edge_cells, cell_change, black_change, middles(lines), *frame)
    said = bend, rough, before, lines, edges, noise
    loose, kept = listened(sums, to_a, to_b, off, *said, values, least, unjudged)
    use, found = trust(sums, to_a, to_b, hidden_misfit(loose, contrasts, sigma), values, least, unjudged)
    noise = found if np.isfinite(found) else noise
    where = xy, beyond, edges, spokes, sigma, noise, True
    step = solution(sums, to_a, to_b, bend, kept, use, lines, contrasts, *where)
    return (sums, use, loose, foot_of(contrasts, black, off), noise) + step


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
