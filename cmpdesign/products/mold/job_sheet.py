"""The job sheet of a mold: pours, operations in order, and every part from two sides, as plain HTML."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from cmpdesign.layout.checks import Finding
from cmpdesign.layout.side import seen_side
from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.mold.make import mold_figures, pad_sizes_mm
from cmpdesign.products.mold.parts import Part
from cmpdesign.products.mold.stack.stack import SILICONE_LAYERS, MoldStack

# Silicone that stays in cups and syringes, in percent of the cast silicone.
LOSS_PERCENT = 30
# Less than a gram of either part cannot be weighed to a percent on a scale of 0.01 g.
LEAST_MIX_G = 2.0
_STYLE = (
    "body{font:15px/1.5 sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse}td,th{padding:.2em .8em;border-bottom:1px solid #ddd;text-align:left}"
    "td.n{text-align:right}figure{display:inline-block;margin:0 1em 1em 0}img{max-width:27em;width:100%}"
    "img.whole{max-width:46em}"
    "li{margin:.4em 0}.warning{background:#fff3d6;padding:.5em 1em}"
)


def job_sheet_html(name: str, stack: MoldStack, parts: Sequence[Part], findings: Sequence[Finding]) -> str:
    """Format the page, which refers to the folder ``pictures/``."""
    body = [
        f"<h1>Casting {escape(name)}</h1>",
        *(f'<p class="warning">{escape(str(finding))}</p>' for finding in findings),
        '<img class="whole" src="pictures/exploded.png" alt="all parts above each other, in the order of use">',
        f"<p>{escape(_side_text(stack))}</p>",
        "<h2>Mix</h2>",
        _pours_html(stack),
        "<h2>Steps</h2>",
        "<ol>" + "".join(f"<li>{text}</li>" for text in _operation_texts(stack)) + "</ol>",
        "<h2>Parts</h2>",
        *(_part_html(part) for part in parts),
    ]
    head = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>Casting {escape(name)}</title>'
    )
    return f"{head}<style>{_STYLE}</style></head><body>\n" + "\n".join(body) + "\n</body></html>\n"


def _side_text(stack: MoldStack) -> str:
    """The camera's side, the layer that must be clear, and the widening of the pad."""
    seen = seen_side(stack.layout.mirrored)
    base, _, cover = (silicone.name for silicone in stack.silicones)
    sizes = pad_sizes_mm(stack)
    narrow, wide = (f"{sizes[face][0]:.2f} x {sizes[face][1]:.2f} mm" for face in ("back", "cover"))
    lies = "as designed" if seen == "back" else "turned over"
    return (
        f"The camera sees the pattern's {seen}, through the base layer: {base} must be clear and without pigment; the "
        f"cover ({cover}) may be pigmented. Seen from above, the pattern lies {lies}. Walls have a draft of "
        f"{stack.options.draft_deg:g} degrees, so the pad widens from {narrow} at its back to {wide} at the cover."
    )


def _pours_html(stack: MoldStack) -> str:
    """The table of pours: volume, mass, and the mass to mix, which includes the losses."""
    rows = []
    base, marker, cover = stack.silicones
    for name, volume in mold_figures(stack)["pour_mm3"].items():
        silicone = base if name == SILICONE_LAYERS[0] else cover if name == SILICONE_LAYERS[2] else marker
        grams = volume * silicone.density_g_cm3.value / 1000
        fields = (
            f"<td>{escape(name)}</td><td>{escape(silicone.name)}</td><td class=n>{volume:.1f} mm³</td>"
            f"<td class=n>{grams:.4f} g</td>"
            f"<td class=n>{max(grams * (1 + LOSS_PERCENT / 100), LEAST_MIX_G):.2f} g</td>"
            f"<td class=n>{silicone.pot_life_min.value:g} min</td><td "
            f"class=n>{silicone.cure_h.value:g} h</td>"
        )
        rows.append(f"<tr>{fields}</tr>")
    mix = f"mix (+{LOSS_PERCENT} %, at least {LEAST_MIX_G:g} g)"
    head = f"<tr><th>layer<th>silicone<th>cast<th>cast<th>{mix}<th>pot life<th>cure</tr>"
    return f"<table>{head}{''.join(rows)}</table>"


def _operation_texts(stack: MoldStack) -> list[str]:
    """The texts of the operations in order."""
    domed = stack.crown is not None
    spread = "spread it over the dome; the plates shape it" if domed else "draw it off flush with the frame"
    level = "wipe along the dome with a soft card" if domed else "draw off flush"
    texts = [
        "Degrease all parts; try whether a drop of each silicone cures on them; spray release agent "
        "on everything "
        "but the pins. Press the four pins into the base: they stand so that no part fits turned.",
        "Degas the base layer's silicone and pour it. Lower the lid on from one side; what is too "
        "much leaves "
        "through the vents and over the land into the moat. Cure level; lift the lid with the two "
        "jack screws (M3).",
        "Lay the frame on the base. Mix the black layer with a retarder and a thixotropic agent, so "
        f"that it stays dough, and {spread}.",
    ]
    for color in stack.colors:
        name = COLORS[color]
        texts.append(
            f"<b>{name}</b>: press the plate <i>boss-{name}</i> down until it lies on the frame; its "
            "bosses then "
            f"stand on the base layer. Let the dough set, lift the plate straight up by its jack screws. Lay "
            f"<i>stencil-{name}</i> on, wipe {name} silicone through it, vacuum until bubbles have "
            "left, wipe again, "
            f"lift the stencil, {level}."
        )
    texts += [
        "Cure the marker layer fully, wipe it with isopropanol.",
        "Lay the cover frame on, pour the protective layer, close with the lid, cure.",
        "Take lid, cover and frame off; peel the pad from the base, starting at a corner; cut the "
        "vents' plugs off.",
    ]
    return texts


def _part_html(part: Part) -> str:
    pictures = "".join(
        f'<figure><img src="pictures/{part.name}-{side}.png" alt="{part.name} from {side}"></figure>'
        for side in ("above", "below")
    )
    return f"<h3>{part.name}</h3><p>{escape(part.use)}</p>{pictures}"
