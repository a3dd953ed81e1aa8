"""Small views of the standard scene, and extractors for them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

from cmpdesign import layout_to_json
from cmpdesign.scene import Optics, Rendered, render
from cmpdesign.scene.standard import standard_layout, standard_scene
from extractor import Extractor, parse_layout

SIZE = (300, 260)
LAYERS = 5


@cache
def extractor(pattern: str, preset: str = "balanced", layers: int = LAYERS) -> Extractor:
    return Extractor(parse_layout(layout_to_json(standard_layout(pattern, layers))), preset)  # type: ignore[arg-type]


def shown(
    pattern: str = "round",
    blur: float = 1.0,
    layers: int = LAYERS,
    size: tuple[int, int] = SIZE,
    **changes: Any,
) -> Rendered:
    plain = standard_scene(standard_layout(pattern, layers))
    return render(replace(plain, optics=Optics(blur), **changes), size=size)
