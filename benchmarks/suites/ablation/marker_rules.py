"""The rules of the markers' initial places, and of their rejection and repair."""

from __future__ import annotations

from benchmarks.suites.ablation.rule import Rule

PLACES = (
    Rule(
        "mapped by triangle",
        "a cell with too few neighbours has the map of its triangle",
        "accuracy",
        "extractor/native/numbering/marker_places.hpp",
        "max_triangle_misfit = 0.3",
        "max_triangle_misfit = 0.0",
    ),
    Rule(
        "corner misfit",
        "a triangle that its neighbours contradict gives no corners",
        "accuracy",
        "extractor/native/numbering/marker_places.hpp",
        "max_corner_misfit = 0.28",
        "max_corner_misfit = 1e9",
    ),
)

REFINEMENT = (
    Rule(
        "last step",
        "the last of the steps by synthesis, where markers still move",
        "errors and time",
        "extractor/native/refine/synthesis_steps.hpp",
        "max_steps = 4",
        "max_steps = 3",
    ),
    Rule(
        "small remainder",
        "no step follows one that leaves little",
        "errors and time",
        "extractor/native/refine/synthesis_steps.cpp",
        "rest.error < small_remainder &&",
        "rest.error < 0.0 &&",
    ),
    Rule(
        "settled appearance",
        "a step follows while blur or dot gain still change",
        "errors and time",
        "extractor/native/refine/synthesis_steps.hpp",
        "small_change = 0.05",
        "small_change = 1e9",
    ),
    Rule(
        "bent gridlines",
        "a step follows a first one that found gridlines bent",
        "errors and time",
        "extractor/native/refine/synthesis_steps.hpp",
        "small_bend = 2.0",
        "small_bend = 1e9",
    ),
    Rule(
        "bending is drawn",
        "markers follow the bending of gridlines once it is drawn",
        "errors and time",
        "extractor/native/refine/refinement_step.cpp",
        "if (has_any(prior.bend)) {",
        "if (true) {",
    ),
    Rule(
        "scatter is drawn",
        "a step follows while markers scatter",
        "errors and time",
        "extractor/native/refine/synthesis_steps.cpp",
        "scatter.variance_px2 == 0.0 && scatter.share == 0.0",
        "scatter.variance_px2 >= 0.0",
    ),
    Rule(
        "scatter",
        "where markers lie by themselves off the smooth map, gridlines do not curve as its tangents say",
        "errors and time",
        "extractor/native/refine/measure/marker_scatter.cpp",
        "if (!(variance > 0.0)) return",
        "if (true) return",
    ),
    Rule(
        "shifted inks",
        "cells of one ink that lie off together are drawn where they lie",
        "errors and time",
        "extractor/native/refine/measure/ink_shift.hpp",
        "min_cells = 12",
        "min_cells = 1000000000",
    ),
)

COMPLETE = (
    Rule(
        "ring outliers",
        "a marker that its two rings contradict is dropped",
        "accuracy",
        "extractor/native/complete/consistency_filter.hpp",
        "max_rounds = 40",
        "max_rounds = 0",
    ),
    Rule(
        "shortest edge",
        "tolerances are of the shortest edge where triangles do not agree",
        "accuracy",
        "extractor/native/complete/consistency_filter.cpp",
        "if (distance < edge_px) edge_px = distance;",
        "if (distance < 0.0) edge_px = distance;",
    ),
    Rule(
        "unexplained",
        "the tolerance is narrower where synthesis does not explain the image",
        "accuracy",
        "extractor/native/complete/consistency_filter.cpp",
        "confirmed ? limits.max_distance : limits.max_unexplained_distance;",
        "limits.max_distance;",
    ),
    Rule(
        "confirmed",
        "a marker that neither triangles nor a certain prediction confirm is dropped",
        "accuracy",
        "extractor/native/complete/consistency_filter.cpp",
        "sigma < max_deviation * edge_px)) return",
        "sigma < max_deviation * edge_px || true)) return",
    ),
    Rule(
        "repair by rings",
        "a lost marker is repaired from its two rings",
        "accuracy",
        "extractor/native/complete/repair.hpp",
        "max_leverage = 1.2",
        "max_leverage = 0.0",
    ),
    Rule(
        "repair by uncertain",
        "lost markers are predicted from uncertain markers, too",
        "accuracy",
        "extractor/native/complete/repair.cpp",
        "if (is_any(lost_) && is_any(Flags(markers_.uncertain))) fill",
        "if (false) fill",
    ),
    Rule(
        "repair by layer",
        "a lost marker is fitted on the quadratic of its layer and sextant",
        "accuracy",
        "extractor/native/complete/repair.hpp",
        "max_fitted_deviation = 0.05",
        "max_fitted_deviation = 0.0",
    ),
    Rule(
        "fusion",
        "an uncertain marker is combined with the prediction by its rings",
        "accuracy",
        "extractor/native/complete/repair.cpp",
        "else if (variance >= 0.0) {",
        "else if (false) {",
    ),
)
