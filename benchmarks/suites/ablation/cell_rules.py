"""The rules of the pipeline and of the stages that find the cells."""

from __future__ import annotations

from benchmarks.suites.ablation.rule import Rule

PIPELINE = (
    Rule(
        "closer look",
        "cells are looked for with more effort where some are missing",
        "accuracy",
        "extractor/pipeline.py",
        "if gains and effort is not self._efforts[-1] and not self._is_whole(found):",
        "if False:",
    ),
    Rule(
        "last look",
        "a look that gains little is the last one",
        "errors and time",
        "extractor/pipeline.py",
        "MIN_GAIN = 1.1  #",
        "MIN_GAIN = 0.0  #",
    ),
    Rule(
        "growing",
        "regions are grown by AGA where the first look misses cells",
        "accuracy",
        "extractor/pipeline.py",
        "if before is not None:\n            cells = stages",
        "if False:\n            cells = stages",
    ),
    Rule(
        "finer scale",
        "small cells are read at a finer scale",
        "no wrong id",
        "extractor/pipeline.py",
        "if found.is_small(view, self._least_edge_px):",
        "if False:",
    ),
)

CELLS = (
    Rule(
        "channels over others",
        "cells are sought in each channel over the mean of the others, too",
        "accuracy",
        "extractor/cells/cells.py",
        "(image, effort.maps,",
        "(image, EFFORTS[0].maps,",
    ),
    Rule(
        "many levels",
        "cells are sought at several levels of the contrast",
        "accuracy",
        "extractor/cells/cells.py",
        "[0.32, 0.5, 0.65])),\n    Effort(np.arange(7), np.array([0.2, 0.42, 0.75]))",
        "[0.5])),\n    Effort(np.arange(7), np.array([0.5]))",
    ),
    Rule(
        "contrast over noise",
        "a cell has more contrast than the noise",
        "no wrong id",
        "extractor/native/cells/cell_candidates.hpp",
        "min_contrast_deviations = 7.0",
        "min_contrast_deviations = 0.0",
    ),
    Rule(
        "ragged shapes",
        "of several regions at one place, ragged ones are worse triangles",
        "accuracy",
        "extractor/native/cells/moments.hpp",
        "ragged_weight = 1.5",
        "ragged_weight = 0.0",
    ),
    Rule(
        "level of half",
        "of several regions at one place, that at half of the contrast is the best",
        "accuracy",
        "extractor/native/cells/cell_candidates.hpp",
        "level_weight = 0.35",
        "level_weight = 0.0",
    ),
    Rule(
        "swelling",
        "the sides of cells are divided by the swelling of their ink",
        "accuracy",
        "extractor/native/cells/cell_mesh.hpp",
        "min_swelling = 0.6, max_swelling = 1.6",
        "min_swelling = 1.0, max_swelling = 1.0",
    ),
    Rule(
        "directions of links",
        "linked cells lie where each other's triangles expect them",
        "no wrong id",
        "extractor/native/cells/cell_mesh.hpp",
        "direction_tolerance = 0.56",
        "direction_tolerance = 1e9",
    ),
    Rule(
        "settled triangles",
        "triangles whose corners move far are measured again",
        "accuracy",
        "extractor/native/cells/triangle_edges.hpp",
        "max_passes = 2",
        "max_passes = 1",
    ),
)
