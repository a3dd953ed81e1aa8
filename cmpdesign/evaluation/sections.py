"""The sections of each report's page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmpdesign.evaluation.reliability import METHODS
from cmpdesign.evaluation.report import plots
from cmpdesign.evaluation.report.page import Plot, ReportTable, Section

Document = Mapping[str, Any]

DIFFERENCES_TITLE = "Differences from the article's figures, and causes"
DIFFERENCES = (
    "The article measured two manufactured sensors at ten places; here one sensor is simulated with "
    "each pattern. The edges are as drawn: no color has bled, and squares merge only by the lens' blur.",
    "Geometry of the optics, size of the image, light, friction and thickness of the elastomer are "
    "assumed: the article does not state them. The elastomer is linear, and loads of this size strain it "
    "by far more than linear theory predicts well.",
)
DIFFERENCES_PRECISION = (
    "The cube's side is ten pitches of the square pattern. Where the cube lies along the square pattern's rows, a "
    "whole row is missed at once. Turned at random, the patterns differ by much less, and virtual markers remove "
    "most of the rest. The change at the aligned cube is no measure of the resolution of an edge.",
    "Under a shear the bonded layer drags its surroundings along: half of the largest movement in y lies "
    "millimetres outside the cube's face with both patterns. Edge points chosen by their depth lie "
    "under the face again.",
)
DIFFERENCES_RESPONSE = (
    "With the assumed friction the cube's face sticks: the markers under it move with it, and the layer "
    "around it follows. The response is near 1 for both patterns, which therefore differ by little.",
)
DIFFERENCES_RELIABILITY = (
    "The square pattern is read by adaptive threshold, erosion, contours and sub-pixel corners. The "
    "article does not describe the former method in detail; a reader that tries several erosions loses "
    "fewer squares that merge.",
    "The multicolor pattern's numbering and its refinement fail independently: where 'multicolor unrefined' "
    "succeeds and 'multicolor' does not, all markers were found and numbered, and refinement then lost "
    "markers or moved them to wrong places where the gridlines bend strongly.",
)


def format_number(value: float | None, digits: int = 3, unit: str = "") -> str:
    """A number with fixed digits and its unit; "none" for None."""
    return "none" if value is None else f"{value:.{digits}f}{unit}"


def format_percent(value: float | None) -> str:
    """A signed percentage; "none" for None."""
    return "none" if value is None else f"{value:+.1f} %"


def conditions_section(document: Document) -> Section:
    """The section on the conditions of a run."""
    return Section(
        "Conditions",
        [
            f"{document['generator']}, seed {document['seed']}, trials of each kind: {document['trials']}, the "
            f"extractor's preset {document['preset']!r}. Simulated from end to end: contact, picture, extraction, "
            "reconstruction. The same seed gives the same figures."
        ],
    )


def differences_section(own_points: Sequence[str]) -> Section:
    """The section on differences from the article: the points of an experiment, then the common points."""
    return Section(DIFFERENCES_TITLE, points=[*own_points, *DIFFERENCES])


def reliability_sections(document: Document) -> list[Section]:
    """The page of ``evaluate reliability``."""
    modes = document["modes"]
    rows = [
        [
            f"{mode.replace('_', ' ')}: {method.replace('_', ' ')}",
            *_success_cells(entry),
            *_criteria_cells(entry),
            _article_cell(entry),
        ]
        for mode, methods in modes.items()
        for method, entry in methods.items()
    ]
    table = ReportTable(
        "Successful trials; 95 % intervals after Wilson.",
        (
            "mode: method",
            "successful",
            "share",
            "95 % interval",
            "with 95 % of the area",
            "no wrong",
            "right in the area",
            "wrong markers",
            "the article",
        ),
        rows,
    )
    plot = Plot("Shares of successful trials, with 95 % intervals.", plots.plot_success_rates(modes, METHODS))
    return [
        conditions_section(document),
        Section(
            "Successful extractions",
            [
                document["definition"],
                "A ball of radius 20 mm presses by 2 mm, then turns by 30 degrees clockwise, or shears by 1.5 mm in x "
                "or y. Place, light, blur, noise and specks are drawn for every trial; they are the same for all "
                "methods.",
                "'Square saddles' is a stronger reader of the square pattern than the article's. 'Multicolor "
                "unrefined' stops at the means of the triangles' corners, where the article's method stops.",
            ],
            tables=[table],
            plots=[plot],
        ),
        differences_section(DIFFERENCES_RELIABILITY),
    ]


def _success_cells(entry: Document) -> list[str]:
    low, high = entry["interval_95"]
    share = entry["share"]
    counts = f"{entry['successful']} of {entry['trials']}"
    return [counts, f"{100 * share:.1f} %", f"{100 * low:.1f} to {100 * high:.1f} %"]


def _criteria_cells(entry: Document) -> list[str]:
    variant = entry["by_criterion"]
    return [
        f"{100 * variant['area_95']['share']:.1f} %",
        f"{100 * variant['no_wrong']['share']:.1f} %",
        format_number(entry["right_in_area_percent"]["mean"], 2, " %"),
        str(entry["wrong_markers"]),
    ]


def _article_cell(entry: Document) -> str:
    return f"{entry['article']['successful']} of {entry['article']['trials']}" if "article" in entry else ""


def precision_sections(document: Document) -> list[Section]:
    """The page of ``evaluate precision``."""
    return [
        conditions_section(document),
        _edge_section(document["edge_fit_error_mm"]),
        _shape_section(document),
        differences_section(DIFFERENCES_PRECISION),
    ]


def _change_rows(cases: Document) -> list[Sequence[str]]:
    """Rows by label: both patterns, the change, and the article's change; variants in further rows."""
    rows: list[Sequence[str]] = []
    for label, entry in cases.items():
        cells = [
            format_number(entry["square"]),
            format_number(entry["multicolor"]),
            format_percent(entry["change_percent"]),
        ]
        rows.append([label, *cells, format_percent(entry["article_change_percent"])])
        for name, variant in entry["variants"].items():
            cells = [
                format_number(variant["square"]),
                format_number(variant["multicolor"]),
                format_percent(variant["change_percent"]),
            ]
            rows.append([f"{label}, {VARIANTS[name]}", *cells, ""])
    return rows


def _edge_section(edges: Document) -> Section:
    rows = _change_rows({MODES[mode]: entry for mode, entry in edges.items()})
    table = ReportTable(
        "Edge fitting error, mm: difference of the fitted square's side and 15 mm, mean over the places.",
        ("mode", "square", "multicolor", "change", "the article"),
        rows,
    )
    sides = {
        mode: {
            m: [abs(s - 15) for s in d["side_mm"] if s is not None] for m, d in entry["distribution"].items()
        }
        for mode, entry in edges.items()
    }
    return Section(
        "Edge fitting error",
        [
            "A cube of 15 mm presses by 1 mm, or presses by 1 mm and shears by 1 mm in y, at ten places 4 mm apart. "
            "Markers that move by more than half of the largest displacement (in z, or along the shear) are its edge "
            "points; the square around them, with the cube's direction, has the larger of their width and height. The "
            "cube "
            "lies along the square pattern's rows, diagonal to the rows (45 degrees), or turned at random."
        ],
        tables=[table],
        plots=[Plot("Every place's error, and the means.", plots.plot_values(sides, "error, mm"))],
    )


MODES = {
    "press": "press",
    "press_diagonal": "press, turned by 45 degrees",
    "press_turned": "press, turned at random",
    "press_shear": "press + shear",
}
VARIANTS = {
    "with_virtual": "virtual markers too",
    "perfect": "markers read without error",
    "perfect_with_virtual": "virtual markers too, read without error",
    "mean_extent": "mean of width and height",
    "by_depth": "edge points by depth",
}


def _shape_section(document: Document) -> Section:
    shapes = document["shape_error_mm"]
    rows = [
        [
            f"{name}: {method}",
            *(
                format_number(_to_um(entry[key]["mean"]), 1)
                for key in ("surface_rms_mm", "depth_rms_mm", "marker_rms_mm")
            ),
            format_number(_to_um(entry["marker_median_mm"]["mean"]), 1),
            *(format_number(entry[key]["mean"], 2) for key in ("over_sigma", "over_sigma_median")),
            *(_format_whole_percent(entry[key]["mean"]) for key in ("covered", "measured")),
        ]
        for name, methods in shapes.items()
        for method, entry in methods.items()
    ]
    headings = (
        "object: pattern",
        "surface",
        "its depth",
        "markers, RMS",
        "markers, median",
        "RMS / sigma",
        "median / sigma",
        "area covered",
        "markers measured",
    )
    table = ReportTable("Errors in micrometres, means over the places.", headings, rows)
    errors = {
        name: {method: _to_um(entry["surface_rms_mm"]["mean"]) for method, entry in methods.items()}
        for name, methods in shapes.items()
    }
    return Section(
        "Shapes of five objects",
        [
            "Each object is pressed by 2 mm. The displacement by the pattern's smooth field is compared with "
            "the true displacement, every 0.25 mm of the area that has moved by at least a tenth of the largest "
            "movement. Where "
            "a marker has no place, its cells give no surface: an error contains only the area covered. Sigma is the "
            "error over the reconstruction's stated deviation: 1 is right. At rest no object is pressed."
        ],
        tables=[table],
        plots=[Plot("Error of the reconstructed surface, RMS.", plots.plot_bars(errors, "RMS, µm"))],
    )


def _to_um(value: float | None) -> float | None:
    return None if value is None else 1000 * value


def _format_whole_percent(share: float | None) -> str:
    return "none" if share is None else f"{100 * share:.1f} %"


def response_sections(document: Document) -> list[Section]:
    """The page of ``evaluate response``."""
    rows = _change_rows({case.replace("_", " "): entry for case, entry in document["response"].items()})
    table = ReportTable(
        "Mean displacement of the edge points over the shear of 1 mm.",
        ("direction", "square", "multicolor", "change", "the article"),
        rows,
    )
    means = {
        case: {m: entry[m] for m in ("square", "multicolor")} for case, entry in document["response"].items()
    }
    plot = Plot("Response by direction.", plots.plot_bars(means, "displacement / shear"))
    return [
        conditions_section(document),
        Section(
            "Response",
            [
                "A cube of 15 mm presses by 1 mm and shears by 1 mm, in x or y, at ten places 4 mm apart. The response "
                "is the mean displacement, along the shear, of the markers that move by more than half of the largest."
            ],
            tables=[table],
            plots=[plot],
        ),
        differences_section(DIFFERENCES_RESPONSE),
    ]


def angle_sections(document: Document) -> list[Section]:
    """The page of ``evaluate angles``."""
    sections = []
    for name, title, equation in (
        ("shape_change_deg", "Shape change", "eq. 1: 360 / n"),
        ("rotation_deg", "Rotation", "eq. 2: 180 / n"),
    ):
        cells = {int(key.removeprefix("n")): entry[name] for key, entry in document["cells"].items()}
        measured = {
            sides: {int(size.removesuffix("px")): angle for size, angle in entry["measured"].items()}
            for sides, entry in cells.items()
        }
        formula = {sides: entry["formula"] for sides, entry in cells.items()}
        sizes = list(next(iter(measured.values())))
        rows = [
            [
                f"n = {n}",
                format_number(formula[n], 1),
                *(format_number(measured[n][size], 1) for size in sizes),
            ]
            for n in measured
        ]
        table = ReportTable(
            "The first angle lost, in degrees.", ("cell", equation, *(f"{size} px" for size in sizes)), rows
        )
        plot = Plot("First angle lost; dashed: the formula.", plots.plot_lost_angles(measured, formula))
        sections.append(Section(title, tables=[table], plots=[plot]))
    rule = [
        document["rule"],
        "The formulas are limits of geometry; a cell of few pixels is lost earlier, because its flattened corner no "
        "longer is a corner of its contour.",
    ]
    return [Section("Rule", rule), *sections]


def design_sections(document: Document) -> list[Section]:
    """The page of ``evaluate designs``."""
    designs = document["designs"]
    rows = [
        [
            name,
            entry["pattern"],
            format_number(entry["pitch_mm"]),
            str(entry["markers"]),
            format_number(entry["markers_per_cm2"], 1),
            format_number(_to_um(entry["surface_rms_mm"]["mean"]), 1),
            format_number(_to_um(entry["marker_rms_mm"]["mean"]), 1),
            format_number(_to_um(entry["marker_median_mm"]["mean"]), 1),
            *(_format_whole_percent(entry[key]["mean"]) for key in ("covered", "measured")),
            format_number(entry["smallest_feature_mm"]),
            format_number(entry["laser_time_s"], 0),
        ]
        for name, entry in designs.items()
    ]
    headings = (
        "design",
        "pattern",
        "pitch, mm",
        "markers",
        "per cm²",
        "surface RMS, µm",
        "markers RMS, µm",
        "median, µm",
        "area covered",
        "markers measured",
        "smallest feature, mm",
        "laser, s",
    )
    points = {
        name: (entry["markers_per_cm2"], _to_um(entry["surface_rms_mm"]["mean"]) or 0.0)
        for name, entry in designs.items()
        if entry["surface_rms_mm"]["mean"] is not None
    }
    return [
        conditions_section(document),
        Section(
            "Designs",
            [
                "All designs have the same contacts of the sensor file at the same places in the same light. The "
                "surface is compared where it moves by a tenth of its largest movement or more; an error contains the "
                "area "
                "covered only. "
                "Pictures without a reading count as 0 % covered and measured, and not in the errors."
            ],
            tables=[ReportTable("Means over all contacts and places.", headings, rows)],
            plots=[Plot("Error against density.", plots.plot_error_over_density(points))],
        ),
    ]
