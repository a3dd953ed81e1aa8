"""Each check finds its fault, with value, limit, unit and remedy; a correct design has no finding."""

from __future__ import annotations

import json

import numpy as np
import pytest

from cmpdesign.design.design import Design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.checks import Finding, check_design
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.measures import cell_angles_deg, cell_areas_mm2, cell_widths_mm, edge_lengths_mm
from cmpdesign.layout.report import design_report, report_to_json
from cmpdesign.patterns import registered_patterns


def findings(**fields: object) -> list[Finding]:
    return check_design(Design(**({"pattern": "honeycomb", "layers": 10, "pitch_mm": 1.5} | fields)))


def test_a_sound_design_has_no_finding() -> None:
    assert findings() == []


@pytest.mark.parametrize(
    ("fields", "subject", "unit", "severity"),
    [
        ({"pitch_mm": 0.1}, "smallest cell", "mm", "error"),
        ({"pitch_mm": 0.4}, "smallest cell", "mm", "warning"),
        ({"pattern": "elliptical", "aspect": 0.25}, "sharpest corner", "deg", "warning"),
        ({"layers": 60}, "shortest edge in a 640x480 picture", "px", "error"),
        ({"layers": 25}, "shortest edge in a 640x480 picture", "px", "warning"),
        ({"layers": 1}, "layers", "", "warning"),
        ({"border_mm": 0}, "black border", "mm", "warning"),
        ({"clip": "circle", "clip_diameter_mm": 15}, "share of markers", "", "warning"),
        ({"palette": {"green": "#c8a02d"}}, "hue distance of red and green", "deg", "error"),
        ({"palette": {"blue": "#7878a0"}}, "saturation of blue", "", "error"),
        ({"palette": {"blue": "#14142d"}}, "contrast of blue", "of 255", "error"),
        ({"palette": {"blue": "#141450"}}, "contrast of blue", "of 255", "warning"),
        ({"palette": {"white": "#808080"}}, "brightness of white", "", "error"),
        ({"palette": {"white": "#ffd080"}}, "saturation of white", "", "error"),
    ],
)
def test_a_fault_is_found(fields: dict[str, object], subject: str, unit: str, severity: str) -> None:
    found = findings(**fields)
    match = [finding for finding in found if finding.subject.startswith(subject)]
    assert [(finding.unit, finding.severity) for finding in match] == [(unit, severity)]
    assert match[0].remedy
    assert f"{match[0].value:.3g}" in str(match[0])
    assert f"limit {match[0].limit:.3g}" in str(match[0])


def test_hue_distance_goes_around_the_circle() -> None:
    palette = {"red": "#c83200", "blue": "#c80032"}
    found = [f for f in findings(palette=palette) if f.subject == "hue distance of red and blue"]
    assert [f.value for f in found] == [pytest.approx(30, abs=1)]


def test_errors_come_first() -> None:
    severities = [finding.severity for finding in findings(pitch_mm=0.1, border_mm=0, layers=1)]
    assert severities == sorted(severities)
    assert set(severities) == {"error", "warning"}


def test_a_camera_with_more_pixels_helps() -> None:
    design = Design(pattern="honeycomb", layers=25, pitch_mm=1.5)
    assert check_design(design)
    assert check_design(design, camera_px=(1280, 960)) == []


def test_measures_of_equilateral_triangles_and_squares() -> None:
    triangles = build_layout(Design(pattern="honeycomb", layers=3, pitch_mm=2))
    np.testing.assert_allclose(edge_lengths_mm(triangles), 2, atol=1e-8)
    np.testing.assert_allclose(cell_areas_mm2(triangles), np.sqrt(3), atol=1e-8)
    np.testing.assert_allclose(cell_widths_mm(triangles), 2 / np.sqrt(3), atol=1e-8)
    np.testing.assert_allclose(cell_angles_deg(triangles), 60, atol=1e-7)
    squares = build_layout(Design(pattern="square", layers=2, pitch_mm=2))
    np.testing.assert_allclose(cell_widths_mm(squares), 2, atol=1e-8)
    np.testing.assert_allclose(cell_angles_deg(squares), 90, atol=1e-7)


def built(**fields: object) -> tuple[Design, Layout]:
    design = Design(**({"pattern": "honeycomb", "layers": 10, "pitch_mm": 1.5} | fields))
    return design, build_layout(design)


def test_report_figures_by_hand() -> None:
    figures = design_report(*built(name="mine"))
    assert (figures.markers, figures.present_markers, figures.edges) == (331, 331, 930)
    assert figures.cells == {"red": 100, "green": 100, "blue": 100, "black": 299, "white": 1}
    assert (figures.virtual_markers, figures.points) == (4650, 4981)
    assert figures.smallest_feature_mm == pytest.approx(1.5 / np.sqrt(3), abs=1e-6)
    assert (figures.sharpest_corner_deg, figures.shortest_edge_mm) == (60.0, 1.5)


def test_the_report_file_carries_figures_and_findings() -> None:
    document = json.loads(
        report_to_json(
            design_report(*built(pitch_mm=0.1, clip="circle", clip_diameter_mm=1.7, border_mm=0.1))
        )
    )
    assert (document["format"], document["version"]) == ("cmp-report", 1)
    assert document["present_markers"] < document["markers"]
    assert {"subject", "value", "limit", "unit", "remedy", "severity", "is_measure"} == set(
        document["findings"][0]
    )
    assert document["findings"][0]["severity"] == "error"


@pytest.mark.parametrize("pattern", sorted(registered_patterns()))
@pytest.mark.parametrize(
    "size", [{"pitch_mm": 0.1, "layers": 4}, {"width_mm": 1.2, "layers": 8, "border_mm": 0}]
)
def test_what_the_remedy_for_small_cells_names_makes_them_larger(
    pattern: str, size: dict[str, float]
) -> None:
    def cell_mm(fields: dict[str, object]) -> float:
        return float(cell_widths_mm(build_layout(Design(**{"pattern": pattern, **fields}))).min())

    found = findings(pattern=pattern, **({"pitch_mm": None} | size))
    remedy = next(f.remedy for f in found if f.subject.startswith("smallest cell"))
    named = {name: value for name, value in size.items() if name in remedy}
    assert named
    for name, value in named.items():
        changed = value / 2 if name == "layers" else value * 2
        assert f"{name} fewer" in remedy if name == "layers" else f"{name} larger" in remedy
        assert cell_mm({**size, name: type(value)(changed)}) > 1.3 * cell_mm({**size})
