"""Writing of a design's files, and checks of a design: the work of ``build`` and ``check``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cmpdesign.design.design import Design
from cmpdesign.layout.checks import CAMERA_PX, Finding, check_design
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.report import DesignReport, design_report
from cmpdesign.patterns.pad_code import CodeFigures, code_figures
from cmpdesign.products.registry import make_products, pads_as_made, product_folders

if TYPE_CHECKING:
    from cmpdesign.products.as_made.reading import PadReading
    from extractor.presets import Preset


@dataclass(frozen=True, eq=False)
class Built:
    """The files and findings of a build.

    Attributes:
        written: the files of the design, in the order of the products.
        removed: files of an earlier build that this build does not make.
        report: the design's key figures.
        readings: name of a product -> the extractor's reading of its pad.
        findings: features of the design and its products that will not or may not work.
        of_other_designs: files in the folder that belong to another design.
    """

    written: tuple[Path, ...]
    removed: tuple[Path, ...]
    report: DesignReport
    readings: Mapping[str, PadReading]
    findings: tuple[Finding, ...]
    of_other_designs: tuple[Path, ...]

    @property
    def works(self) -> bool:
        """False when a finding is an error."""
        return not any(finding.severity == "error" for finding in self.findings)


@dataclass(frozen=True, eq=False)
class Checked:
    """The findings on a design.

    Attributes:
        findings: errors first.
        readings: name of a product -> the extractor's reading of its pad; empty unless pads were read.
        unread: name of a product -> why its pad cannot be made and is not read.
        code: key figures of the pad's code; None without a code.
    """

    findings: tuple[Finding, ...]
    readings: Mapping[str, PadReading]
    unread: Mapping[str, str]
    code: CodeFigures | None = None

    @property
    def works(self) -> bool:
        """False when a finding is an error."""
        return not any(finding.severity == "error" for finding in self.findings)


def build_files(
    design: Design,
    layout: Layout,
    folder: str | Path,
    names: Sequence[str],
    camera_px: tuple[int, int] = CAMERA_PX,
    *,
    preset: Preset = "balanced",
) -> Built:
    """Write the files of a design.

    Args:
        design: the design.
        layout: its layout.
        folder: folder for the files; made if missing.
        names: products to make, see ``chosen_products``.
        camera_px: width and height of the camera image that the pattern fills.
        preset: preset of the extractor, for the reading of pads.

    Raises:
        CmpDesignError: a product cannot be made; no file has been written.
        OutputError: a file cannot be written; existing files are unchanged.
    """
    from cmpdesign.files.atomic import write_folder
    from cmpdesign.files.earlier_files import LIST_NAME, files_with_lists, find_stale_files, remove_files
    from cmpdesign.files.layout_json import pattern_digest
    from cmpdesign.files.other_designs import find_other_designs
    from cmpdesign.products.as_made.reading import clip_findings

    folder = Path(folder)
    report = design_report(design, layout, camera_px)
    made = make_products(names, design, layout, report, camera_px, preset=preset)
    pattern = pattern_digest(layout)
    listed = files_with_lists(made.files, product_folders(), folder, pattern)
    stale = find_stale_files(folder, listed, product_folders(), pattern)
    written = write_folder(folder, listed)
    removed = remove_files(stale)
    return Built(
        written=tuple(path for path in written if path.name != LIST_NAME),
        removed=tuple(path for path in removed if path.name != LIST_NAME),
        report=report,
        readings=made.readings,
        findings=(*report.findings, *clip_findings(layout, camera_px), *made.findings),
        of_other_designs=tuple(find_other_designs(folder, product_folders(), layout.digest, pattern)),
    )


def check_products(
    design: Design,
    layout: Layout,
    camera_px: tuple[int, int] = CAMERA_PX,
    *,
    read: bool = False,
    preset: Preset = "balanced",
) -> Checked:
    """The features of a design that cannot be made or read.

    Args:
        design, layout, camera_px, preset: see ``build_files``.
        read: also draw and read the pads that laser, mold and print would make.
    """
    from cmpdesign.products.as_made.reading import clip_findings, read_pads

    findings = [*check_design(design, layout, camera_px), *clip_findings(layout, camera_px)]
    code = None if layout.code is None else code_figures(int(layout.parameters["layers"]), layout.code)
    if not read:
        return Checked(tuple(findings), {}, {}, code)
    pads, unread = pads_as_made(design, layout)
    found = read_pads(pads, camera_px, preset)
    findings = sorted([*findings, *found.findings], key=lambda finding: finding.severity)
    return Checked(tuple(findings), found.readings, unread, code)
