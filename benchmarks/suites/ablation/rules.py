"""The rules of the reader outside refinement, each with the text of its source that switches it off.

A rule is a threshold, a branch or a fallback that the reader would work without. A text occurs exactly once in its
module. The stages themselves (inks, growing, mesh, walk) are no rules.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

Kind = Literal["accuracy", "no wrong id"]


class Rule(NamedTuple):
    """One rule.

    Attributes:
        name: of the rule.
        purpose: what the rule is for.
        kind: by what it is judged: by counts and errors in the five suites, or by the wrong ids that it prevents.
        module: dotted, of the reader.
        text: of the module, to be replaced.
        without: the text that replaces it and switches the rule off.
    """

    name: str
    purpose: str
    kind: Kind
    module: str
    text: str
    without: str

    @property
    def stage(self) -> str:
        """The folder of the reader that holds the rule, or ``pipeline``."""
        return self.module.split(".")[1]


PIPELINE = (
    Rule(
        "small pattern",
        "a small pattern in a large image numbered by the centers of its cells",
        "accuracy",
        "extractor.pipeline",
        "return self._number_by_centers(pyramid, seeds, scale, stages) or Unnumbered(Reason.NO_COLOR)",
        "return Unnumbered(Reason.NO_COLOR)",
    ),
    Rule(
        "attach",
        "detached cells numbered by contact or prediction, inconsistent ones dropped",
        "accuracy",
        "extractor.pipeline",
        "if numbering.doubt is None:",
        "if False:",
    ),
)

IMAGE = (
    Rule(
        "target",
        "pixels outside the target area carry no ink",
        "accuracy",
        "extractor.image.target_area",
        "return 1 - _flooded(closed)",
        "return np.ones_like(closed)",
    ),
    Rule(
        "pale pixels",
        "pale pixels do not vote for the inks' hues",
        "accuracy",
        "extractor.image.color",
        "range(max(MIN_CHROMA, strong // PALE_DIVISOR), low_counts.shape[1])",
        "range(MIN_CHROMA, low_counts.shape[1])",
    ),
    Rule(
        "lowest level",
        "the local level of an ink is at least a share of its typical level",
        "accuracy",
        "extractor.image.ink_segmentation",
        "local = LEVEL_SHARE * max(total / count, MIN_LEVEL_SHARE * typical[ink])",
        "local = LEVEL_SHARE * total / count",
    ),
    Rule(
        "local levels",
        "the level of an ink is local",
        "accuracy",
        "extractor.image.ink_segmentation",
        "local = LEVEL_SHARE * max(total / count, MIN_LEVEL_SHARE * typical[ink])",
        "local = LEVEL_SHARE * typical[ink]",
    ),
)

CELLS = (
    Rule(
        "clutter",
        "of too many domains only solid ones are kept",
        "accuracy",
        "extractor.cells.seeds",
        "cluttered = np.count_nonzero(area >= MIN_DOMAIN_PX) > max_domains",
        "cluttered = False",
    ),
    Rule(
        "larger neighbours",
        "domains much smaller than their neighbours are no cells",
        "accuracy",
        "extractor.cells.cells",
        "return _has_few_larger_neighbours(center, area, MIN_AREA_SHARE, NEAREST_CELLS // 2)",
        "return np.ones(area.shape[0], np.bool_)",
    ),
    Rule(
        "intact cells",
        "cells smaller than their neighbours are damaged and predict nothing",
        "no wrong id",
        "extractor.cells.cells",
        "return candidate & _has_few_larger_neighbours(center, area, MIN_INTACT_SHARE, NEAREST_CELLS // 4 + 1)",
        "return candidate",
    ),
    Rule(
        "flips",
        "edges between cells of one ink are flipped to the other diagonal",
        "accuracy",
        "extractor.cells.cell_mesh",
        "if flips == 0:",
        "if True:",
    ),
    Rule(
        "shared corner",
        "the cells of a face share corners",
        "no wrong id",
        "extractor.cells.cell_mesh",
        "return nearest < limit",
        "return True",
    ),
    Rule(
        "shorter profiles",
        "large cells are measured again by shorter profiles",
        "accuracy",
        "extractor.cells.triangle_edges",
        "for number in range(MAX_PASSES):",
        "for number in range(1):",
    ),
)

NUMBERING = (
    Rule(
        "contradictions",
        "cells that the walk reaches with two numbers are left out",
        "no wrong id",
        "extractor.numbering.lattice_walk",
        "if not bad.any():",
        "if True:",
    ),
    Rule(
        "least cells",
        "a component explains a share of the cells in the image",
        "no wrong id",
        "extractor.numbering.lattice_walk",
        "return max(of_layout, min(MIN_MESH_SHARE * meshed, SUFFICIENT_CELLS))",
        "return of_layout",
    ),
    Rule(
        "relative whiteness",
        "places less white than the whitest are no white cells",
        "no wrong id",
        "extractor.numbering.lattice_walk",
        "found = [one for one in found if one.white >= white]",
        "",
    ),
    Rule(
        "white beside",
        "a white cell that touches walked cells goes before a farther one",
        "no wrong id",
        "extractor.numbering.lattice_walk",
        "key=lambda one: (one.white_adjacent, one.score)",
        "key=lambda one: one.score",
    ),
    Rule(
        "rivals",
        "a second place with the surroundings of the white cell makes the numbering doubtful",
        "no wrong id",
        "extractor.numbering.lattice_walk",
        "doubt = _doubt(best, rivals, min_cells)",
        "doubt = None",
    ),
    Rule(
        "outline",
        "without a white cell the outline gives the origin",
        "accuracy",
        "extractor.numbering.lattice_walk",
        "best = _candidate_from_outline(lattice, walk) or best",
        "pass",
    ),
    Rule(
        "outline margin",
        "the second alignment with the outline leaves many more cells outside",
        "no wrong id",
        "extractor.numbering.outline_fit",
        "if not best <= max_outside or next_best - best < margin:",
        "if not best <= max_outside or next_best == best:",
    ),
    Rule(
        "marker turn",
        "markers are brighter than black cells, which tells the view's side",
        "no wrong id",
        "extractor.numbering.mesh_parts",
        "return [front] if front != 0 else [1, -1]",
        "return [1, -1]",
    ),
    Rule(
        "far white cell",
        "the white cell is searched up to 3.7 edges from the walked cells",
        "accuracy",
        "extractor.numbering.white_search",
        "for ring in range(RING_STARTS.shape[0] - 1):",
        "for ring in range(1):",
    ),
    Rule(
        "dark between inks",
        "between the inks the pattern is black",
        "no wrong id",
        "extractor.numbering.white_search",
        "return between > 0 and dark / between >= MIN_BLACK_SHARE",
        "return True",
    ),
    Rule(
        "relative brightness",
        "places less bright than the brightest are no white cells",
        "no wrong id",
        "extractor.numbering.white_search",
        "if found.brightness[n] > MIN_RELATIVE_BRIGHTNESS * brightest",
        "",
    ),
    Rule(
        "white triangle",
        "the white cell fills its triangle and ends with it",
        "no wrong id",
        "extractor.numbering.white_cell",
        "if not _fill_mean_color(image, middle, slope, 0.0, 0.0, own):\n        return False\n",
        "if own.shape[0] == 3:\n        return True\n",
    ),
    Rule(
        "between inks",
        "the cells beside the white one show their inks",
        "no wrong id",
        "extractor.numbering.white_cell",
        "    own = np.empty(3)\n    for k in range(3):\n",
        "    own = np.empty(3)\n    for k in range(0):\n",
    ),
    Rule(
        "white centroid",
        "the white cell is tried at the centroid of the white, too",
        "accuracy",
        "extractor.numbering.white_cell",
        "if not u * u + u * v + v * v <= MAX_CENTROID_DISTANCE**2:",
        "if True:",
    ),
    Rule(
        "channel balance",
        "a place with a weak channel is colored, not white",
        "no wrong id",
        "extractor.numbering.whiteness",
        "white = weakest if weakest > MIN_CHANNEL_BALANCE * most else 0.0",
        "white = weakest",
    ),
)

GAPS = (
    Rule(
        "touch",
        "cells in contact with numbered ones are numbered",
        "accuracy",
        "extractor.numbering.gaps.detached_cells",
        "touched = update_numbers_by_contact(cells, layout, corner_step, triangles, new_cells, numbering)",
        "touched = new_cells[:0]",
    ),
    Rule(
        "claims",
        "cells across a gap are numbered by prediction",
        "accuracy",
        "extractor.numbering.gaps.detached_cells",
        "if known.shape[0] < MIN_NUMBERED_CELLS or np.all(numbering.cell[unnumbered] >= 0):",
        "if known.shape[0] >= 0:",
    ),
    Rule(
        "unique claim",
        "a cell of the layout that two cells claim is given to neither",
        "no wrong id",
        "extractor.numbering.gaps.detached_cells",
        "if place >= 0 and assignments.candidate_count[place] == 1 and assignments.gap[n] <= limit:",
        "if place >= 0 and numbering.free[place] and assignments.gap[n] <= limit:",
    ),
    Rule(
        "nearest first",
        "the cells nearest to numbered ones are numbered first",
        "no wrong id",
        "extractor.numbering.gaps.cell_claims",
        "return max(JOINT_GAP, JOINT_GAP_RATIO * least), next_gap",
        "return np.inf, next_gap",
    ),
    Rule(
        "gap check",
        "cells numbered across a gap continue the pattern",
        "no wrong id",
        "extractor.numbering.gaps.gap_check",
        "    consistent, singles = block == reference, np.flatnonzero((cell >= 0) & (block < 0))\n",
        "    consistent, singles = cell >= 0, np.flatnonzero(cell < -1)\n    blocks = 1\n",
    ),
    Rule(
        "single cells",
        "single cells across a gap continue the pattern, too",
        "no wrong id",
        "extractor.numbering.gaps.gap_check",
        "state.is_consistent[j] = jump < MAX_SINGLE_JUMP and np.sqrt(square[0]) < MAX_GAP * edge",
        "state.is_consistent[j] = True",
    ),
    Rule(
        "first check",
        "cells are checked before detached ones are numbered, too",
        "no wrong id",
        "extractor.numbering.gaps.detached_cells",
        "cell, removed = _remove_inconsistent(cell, consistent)",
        "cell, removed = _remove_inconsistent(cell, np.ones_like(consistent))",
    ),
    Rule(
        "white contradicted",
        "the cells around a white cell that they do not touch agree with it",
        "no wrong id",
        "extractor.numbering.gaps.detached_cells",
        "doubt=Reason.AMBIGUOUS if is_ambiguous else None",
        "doubt=None",
    ),
    Rule(
        "both triangles",
        "of two cells in contact each predicts the other",
        "no wrong id",
        "extractor.numbering.gaps.corner_contact",
        "if _is_neighbour_predicted(cells, j, i, v, u, turned, layout, corner_step):",
        "if True:",
    ),
)

PLACES = (
    Rule(
        "mapped by triangle",
        "a cell with too few neighbours has the map of its triangle",
        "accuracy",
        "extractor.localmap.affine_maps",
        "if misfit[best] < MAX_MISFIT and min(misfit[best - 1], misfit[best - 2]) > MIN_RIVAL_MISFIT:",
        "if False:",
    ),
    Rule(
        "corner misfit",
        "a triangle that its neighbours contradict gives no corners",
        "accuracy",
        "extractor.numbering.marker_places",
        "fitted[n] = misfit[best] < (MAX_CORNER_MISFIT * edge[n]) ** 2",
        "fitted[n] = misfit[best] < np.inf",
    ),
    Rule(
        "corner spread",
        "a marker whose triangles disagree is lost",
        "accuracy",
        "extractor.numbering.marker_places",
        "if square > (MAX_CORNER_SPREAD * edge[m]) ** 2:",
        "if False:",
    ),
    Rule(
        "damaged cells",
        "where most cells have triangles, the edges of one without are not drawn",
        "accuracy",
        "extractor.numbering.marker_places",
        "if is_known and (corners.is_kept[n] or not corners.is_sharp):",
        "if is_known:",
    ),
    Rule(
        "cut cells",
        "cells that the image's border cuts off are drawn without a triangle",
        "accuracy",
        "extractor.numbering.marker_places",
        "kept[n] = fitted[n] or not is_inside",
        "kept[n] = fitted[n]",
    ),
    Rule(
        "unmatched rim",
        "a rejected triangle at the rim gives a corner that the neighbouring markers predict",
        "accuracy",
        "extractor.numbering.marker_places",
        "unmatched = merged.is_unmatched & lattice.is_rim",
        "unmatched = merged.is_unmatched & False",
    ),
)

COMPLETE = (
    Rule(
        "ring outliers",
        "a marker that its two rings contradict is dropped",
        "accuracy",
        "extractor.complete.consistency_filter",
        "_update_rejecting_outliers(xy, cov, tolerance_px, judged, tables)",
        "pass",
    ),
    Rule(
        "shortest edge",
        "tolerances are of the shortest edge where triangles do not agree",
        "accuracy",
        "extractor.complete.consistency_filter",
        "edge_px[m] = _shortest_edge(xy, m, first_ring, edge_px[m])",
        "pass",
    ),
    Rule(
        "unexplained",
        "the tolerance is narrower where synthesis does not explain the image",
        "accuracy",
        "extractor.complete.consistency_filter",
        "allowed = MAX_UNEXPLAINED_DISTANCE",
        "pass",
    ),
    Rule(
        "agreed unexplained",
        "the tolerance is slightly narrower where triangles agree and synthesis explains nothing",
        "accuracy",
        "extractor.complete.consistency_filter",
        "allowed = MAX_AGREED_UNEXPLAINED_DISTANCE",
        "pass",
    ),
    Rule(
        "confirmed",
        "a marker that neither triangles nor a certain prediction confirm is dropped",
        "accuracy",
        "extractor.complete.consistency_filter",
        "if not (explained or is_intact or sigma < max_deviation * edge_px):",
        "if False:",
    ),
    Rule(
        "repair by rings",
        "a lost marker is repaired from its two rings",
        "accuracy",
        "extractor.complete.repair",
        "return (MILD_ERROR * leverage) ** 2 * variance + outer_error",
        "return np.nan",
    ),
    Rule(
        "repair by uncertain",
        "lost markers are predicted from uncertain ones, too",
        "accuracy",
        "extractor.complete.repair",
        "if lost.any() and uncertain.any():",
        "if False:",
    ),
    Rule(
        "repair by cells",
        "a lost marker is repaired by the corners that its cells imply",
        "accuracy",
        "extractor.complete.repair",
        "return 0.25 * distance2 + own",
        "return np.nan",
    ),
    Rule(
        "repair by cubic",
        "a lost marker in nearly whole rings is repaired on a bent surface",
        "accuracy",
        "extractor.complete.repair",
        "return variance if variance < (MAX_REPAIRED_DEVIATION * edge_px) ** 2 else np.nan",
        "return np.nan",
    ),
    Rule(
        "repair by layer",
        "a lost marker is fitted on the quadratic of its layer and sextant",
        "accuracy",
        "extractor.complete.repair",
        "return HEAVY_ERROR * residual + (MODEL_DEVIATION * edge_px) ** 2",
        "return np.nan",
    ),
    Rule(
        "fusion",
        "an uncertain marker is fused with the prediction by its rings",
        "accuracy",
        "extractor.complete.repair",
        "elif variance >= 0.0:",
        "elif False:",
    ),
    Rule(
        "inner ring",
        "a repair is refused where the inner ring alone predicts another place",
        "accuracy",
        "extractor.complete.repair",
        "model_error = (OUTER_RING_ERROR * edge_px) ** 2 if unconfirmed else (dx * dx + dy * dy) / 4",
        "model_error = 0.0",
    ),
)

RULES = (*PIPELINE, *IMAGE, *CELLS, *NUMBERING, *GAPS, *PLACES, *COMPLETE)
BY_NAME = {rule.name: rule for rule in RULES}
