"""Default values of the experiments."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import get_args

from cmpdesign.inputs.options import Preset

# Trials of each kind by the experiment's name.
USUAL_TRIALS: Mapping[str, int] = MappingProxyType(
    {"precision": 10, "response": 10, "reliability": 300, "angles": 1, "designs": 5}
)
PRESETS = get_args(Preset)
