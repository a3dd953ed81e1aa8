"""docs/reference/gallery.md: every registered pattern and every template, with previews."""

from __future__ import annotations

import cv2
import numpy as np

from cmpdesign.design.design import load_design
from cmpdesign.design.templates import templates
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.report import design_report
from cmpdesign.patterns import registered_patterns
from cmpdesign.products.drawing.preview import MARGIN_PX, TITLE_PX, draw_preview

WIDTH_PX = 520
PATTERN_LAYERS = 4  # few enough for readable ids
HEAD = """# Gallery

Everything below is written by `python -m tools.figures` from the registry and the templates: a new pattern or template
appears here by itself. Previews show the **front**, ids where there is room for them.

```console
$ cmpdesign build honeycomb -o out --set layers=4
wrote out/pattern.svg
wrote out/layout.json
wrote out/preview.png
wrote out/report.json
pattern           honeycomb, 4 layers, pitch 1.5 mm
markers           61
virtual markers   780 on 156 edges (841 points)
cells             96: 16 red, 16 green, 16 blue, 47 black, 1 white
overall size      14.31 x 12.39 mm, border included
smallest feature  0.866 mm (circle inside the narrowest cell)
```
"""


def figures() -> dict[str, bytes]:
    """File name -> PNG."""
    shown = {
        f"pattern-{name}.png": _preview(name, {"layers": str(PATTERN_LAYERS)})
        for name in registered_patterns()
    }
    return shown | {f"template-{name}.png": _preview(name, {}) for name in templates()}


def page() -> str:
    """docs/reference/gallery.md."""
    parts = [HEAD, "\n## Patterns\n"]
    for name, pattern in registered_patterns().items():
        options = ", ".join(f"`{option}`" for option in sorted(pattern.options))
        note = f"Options of its own: {options}." if options else "No options of its own."
        parts.append(
            f"\n### {name}\n\n{pattern.summary}\n{note}\n\n"
            f"![The pattern {name} with {PATTERN_LAYERS} layers](../images/pattern-{name}.png)\n"
        )
    parts.append("\n## Templates\n")
    parts += [_template(name) for name in templates()]
    return "".join(parts)


def _template(name: str) -> str:
    design = load_design(name)
    report = design_report(design, build_layout(design))
    width, height = report.size_mm
    return (
        f"\n### {name}\n\n{design.description}\n\n"
        f"- {report.pattern}, {report.layers} layers, pitch {report.pitch_mm:.4g} mm\n"
        f"- {report.present_markers} markers, {report.virtual_markers} virtual ones on {report.edges} edges\n"
        f"- {width:.2f} x {height:.2f} mm with its border; seen from the {'back' if design.mirrored else 'front'}\n"
        f"- source: {design.source}\n\n"
        f"![The template {name}](../images/template-{name}.png)\n"
    )


def _preview(name: str, overrides: dict[str, str]) -> bytes:
    # The title is cut off, because the text states the same facts.
    picture = draw_preview(build_layout(load_design(name, overrides)))[MARGIN_PX + TITLE_PX - 35 :]
    height = round(picture.shape[0] * WIDTH_PX / picture.shape[1])
    small = cv2.resize(picture, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
    stepped = np.where(small > 245, small, small // 4 * 4 + 2).astype(np.uint8)
    return bytes(cv2.imencode(".png", stepped, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1])
