"""The rules of the pipeline and of the stages that find the inks and the cells."""

from __future__ import annotations

from benchmarks.suites.ablation.rule import Rule

PIPELINE = (
    Rule(
        "small pattern",
        "a small pattern in a large image numbered by the centers of its cells",
        "accuracy",
        "extractor/pipeline.py",
        "return self._number_by_centers(pyramid, seeds, scale, stages) or Unnumbered(Reason.NO_COLOR)",
        "return Unnumbered(Reason.NO_COLOR)",
    ),
    Rule(
        "attach",
        "detached cells are numbered by contact or prediction, inconsistent cells are dropped",
        "accuracy",
        "extractor/pipeline.py",
        "if numbering.doubt is None:",
        "if False:",
    ),
)

IMAGE = (
    Rule(
        "grey card",
        "the color of the light is taken from the image before hues are read",
        "accuracy",
        "extractor/image/grey_card.py",
        "return self.ratio <= LIMITS.white_ratio",
        "return True",
    ),
    Rule(
        "local grey card",
        "the color of the light is local",
        "accuracy",
        "extractor/image/grey_card.py",
        "sigma_share: float = 0.15",
        "sigma_share: float = 100.0",
    ),
    Rule(
        "target",
        "pixels outside the target area carry no ink",
        "accuracy",
        "extractor/native/image/target_area.cpp",
        "for (std::uint8_t& one : mask.flat()) one = 1 - one;",
        "mask.fill(1);",
    ),
    Rule(
        "local levels",
        "the level of an ink is local",
        "accuracy",
        "extractor/native/image/ink_segmentation.cpp",
        "limits.level_share * (total / count)",
        "limits.level_share * typical[ink]",
    ),
)

CELLS = (
    Rule(
        "clutter",
        "of too many domains only solid domains are kept",
        "accuracy",
        "extractor/cells/seeds.py",
        "native.find_domains(segmentation.label, max_domains, LIMITS)",
        "native.find_domains(segmentation.label, NO_DOMAIN_LIMIT, LIMITS)",
    ),
    Rule(
        "larger neighbours",
        "domains much smaller than their neighbours are no cells",
        "accuracy",
        "extractor/cells/cells.py",
        "min_area_share: float = 0.2",
        "min_area_share: float = 0.0",
    ),
    Rule(
        "intact cells",
        "cells smaller than their neighbours are damaged and predict nothing",
        "no wrong id",
        "extractor/cells/cells.py",
        "min_intact_share: float = 0.7",
        "min_intact_share: float = 0.0",
    ),
    Rule(
        "flips",
        "edges between cells of one ink are flipped to the other diagonal",
        "accuracy",
        "extractor/cells/cell_mesh.py",
        "max_flip_rounds: int = 12",
        "max_flip_rounds: int = 0",
    ),
    Rule(
        "shared corner",
        "the cells of a face share corners",
        "no wrong id",
        "extractor/cells/cell_mesh.py",
        "max_corner_gap: float = 0.4",
        "max_corner_gap: float = np.inf",
    ),
    Rule(
        "shorter profiles",
        "large cells are measured again by shorter profiles",
        "accuracy",
        "extractor/cells/triangle_edges.py",
        "max_passes: int = 3",
        "max_passes: int = 1",
    ),
)
