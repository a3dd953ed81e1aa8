"""Every option changes the product, or has a finding that states the option's lack of effect."""

from __future__ import annotations

import pytest

from cmpdesign import build_layout, load
from cmpdesign.design.mold_options import MoldOptions
from cmpdesign.design.sheet_options import SheetOptions
from cmpdesign.products.mold.checks.findings import check_mold
from cmpdesign.products.mold.make import mold_figures
from cmpdesign.products.mold.parts import make_parts
from cmpdesign.products.mold.stack.stack import make_stack
from cmpdesign.products.sheet.print_sheet import prepare_print_sheet

CROWNS = {
    "none": {},
    "sphere": {"mold.crown": "sphere", "mold.crown_radius_mm": "12"},
    "cylinder": {"mold.crown": "cylinder", "mold.crown_radius_mm": "12"},
}
# Another value than usual for every field.
OTHER = {
    "tool": "steel", "base_silicone": "sylgard-184", "marker_silicone": "sylgard-184",
    "cover_silicone": "sylgard-184", "base_mm": "5", "marker_mm": "0.6", "cover_mm": "0.6", "draft_deg": "3",
    "tip_radius_mm": "0.08", "gap_mm": "0.12", "minimum_feature_mm": "0.9", "crown_radius_mm": "15",
    "projection": "vertical", "floor_mm": "4", "plate_mm": "4", "stencil_mm": "0.6", "wall_mm": "4",
    "fillet_mm": "1", "clearance_mm": "0.12", "pin_diameter_mm": "2.2", "vents": "5", "vent_mm": "0.7",
    "parting_mm": "0.9", "moat_mm": "0.9", "moat_depth_mm": "1.2",
}  # fmt: skip
SHEET = {
    "page": "letter",
    "pads": "2",
    "bleed_mm": "1",
    "film": "clear",
    "ruler": "true",
    "dot_gain_mm": "0.03",
}


def made_of(**values: str) -> tuple[object, list[str]]:
    """The figures of the parts from closed forms, and the findings on the parts."""
    design = load("honeycomb", {"layers": "3", **values})
    stack = make_stack(design, build_layout(design))
    parts = [(part.name, round(part.z_mm, 9), round(part.volume_mm3, 9)) for part in make_parts(stack)]
    return (parts, mold_figures(stack)["pour_mm3"]), [str(finding) for finding in check_mold(stack)]


def test_every_field_has_another_value_here() -> None:
    assert {*OTHER, "crown"} == set(MoldOptions.model_fields) and set(SHEET) == set(SheetOptions.model_fields)


@pytest.mark.parametrize("crown", CROWNS)
def test_every_option_of_a_mold_has_an_effect_or_a_finding(crown: str) -> None:
    parts, findings = made_of(**CROWNS[crown])
    told = set()
    for field, value in OTHER.items():
        other, said = made_of(**{**CROWNS[crown], f"mold.{field}": value})
        assert other != parts or said != findings, field
        if other == parts:
            told.add(field)
    # A material and a limit change what can be said only; the others of these are said to be unused.
    assert told == {"tool", "minimum_feature_mm"} | (
        {"crown_radius_mm", "projection"} if crown == "none" else set()
    )


def test_options_that_are_not_used_are_named() -> None:
    _, flat = made_of(**{"mold.crown_radius_mm": "15", "mold.projection": "vertical"})
    assert any("mold.crown_radius_mm: 15 mm" in text and "not used on a flat pad" in text for text in flat)
    assert any('mold.projection = "vertical"' in text for text in flat)
    _, narrow = made_of(**CROWNS["sphere"], border_mm="0.5")
    assert any("border_mm: 0.5 mm, limit 1 mm; this width is taken" in text for text in narrow)
    _, clipped = made_of(**CROWNS["sphere"], layers="4", clip="circle", clip_diameter_mm="11")
    assert any("whose edge follows its crown (sphere)" in text for text in clipped)


@pytest.mark.parametrize("field", sorted(SHEET.keys() - {"dot_gain_mm"}))  # which prints as made have alone
def test_every_option_of_a_sheet_has_an_effect(field: str) -> None:
    def sheet(**values: str) -> str | bytes:
        design = load("honeycomb", {"layers": "3", **values})
        return prepare_print_sheet(design, build_layout(design)).make().files["print/sheet.svg"]

    assert sheet(**{f"sheet.{field}": SHEET[field]}) != sheet()
