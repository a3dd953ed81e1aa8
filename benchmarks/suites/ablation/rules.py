"""All rules of the reader outside refinement; the modules that are imported here hold their texts."""

from __future__ import annotations

from benchmarks.suites.ablation.cell_rules import CELLS, PIPELINE
from benchmarks.suites.ablation.marker_rules import COMPLETE, PLACES, REFINEMENT
from benchmarks.suites.ablation.numbering_rules import ATTACHMENT, REGISTRATION, WALK

RULES = (*PIPELINE, *CELLS, *WALK, *REGISTRATION, *ATTACHMENT, *PLACES, *REFINEMENT, *COMPLETE)
BY_NAME = {rule.name: rule for rule in RULES}
