"""Designs for programs: loaded, changed, checked, written, shown in notebooks."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.api.layouts import Layout, build_layout
from cmpdesign.design.design import Design as Parameters
from cmpdesign.design.design import load_design
from cmpdesign.inputs.options import Preset, pixels_of
from cmpdesign.layout.checks import CAMERA_PX
from cmpdesign.products.building import Built, Checked, build_files, check_products
from cmpdesign.products.registry import USUAL_NAMES, chosen_products

if TYPE_CHECKING:
    from cmpdesign.layout.report import DesignReport


class Design(Parameters):
    """A design: a few parameters from which the pattern and all files follow.

    >>> import cmpdesign
    >>> design = cmpdesign.load("tac3d", layers=8)        # a template, or a TOML file, with values changed
    >>> design = cmpdesign.Design(pattern="honeycomb", layers=8, pitch_mm="60mil")
    >>> design.layout                                     # every marker, cell and edge; a notebook draws it
    >>> design.check()                                    # the features that cannot be made or read
    >>> design.write("out")                               # pattern.svg, layout.json, preview.png, report.json
    >>> design.write("out", products=["laser", "mold"])   # a laser job, a casting mold
    >>> design.changed(layers=9)                          # another design; this one does not change

    Every parameter is an attribute, such as ``design.pitch_mm``; docs/reference/design-files.md lists all parameters.
    Lengths are in mm, or texts such as "60mil". A size is given as ``pitch_mm`` and ``layers``; ``width_mm`` and/or
    ``height_mm`` and ``layers``; these and ``pitch_mm``; or ``pitch_mm`` and a clip outline.

    Raises:
        DesignError: an unknown, missing, impossible or contradictory parameter.
    """

    def __init__(self, /, **parameters: Any) -> None:
        super().__init__(**parameters)

    @classmethod
    def of(cls, parameters: Parameters) -> Design:
        """The same design with the methods of this class."""
        if isinstance(parameters, cls):
            return parameters
        values = {name: getattr(parameters, name) for name in type(parameters).model_fields}
        return cls.model_construct(set(parameters.model_fields_set), **values)

    def changed(self, **changes: Any) -> Design:
        """A design with other values; None removes a value, as in ``design.changed(layers=None, width_mm=30)``.

        Raises:
            DesignError: the values contradict each other.
        """
        values = {name: getattr(self, name) for name in self.model_fields_set} | changes
        return Design(**{name: value for name, value in values.items() if value is not None})

    @cached_property
    def layout(self) -> Layout:
        """Every marker, cell and edge.

        Raises:
            DesignError: the sizes cannot be resolved; see ``cmpdesign.build_layout``.
        """
        return build_layout(self)

    @cached_property
    def report(self) -> DesignReport:
        """The key figures: numbers of markers and cells, sizes in mm, findings for a camera of 640 x 480 px."""
        from cmpdesign.layout.report import design_report

        return design_report(self, self.layout)

    def check(
        self, camera: tuple[int, int] = CAMERA_PX, *, read: bool = False, preset: Preset = "balanced"
    ) -> Checked:
        """The features that cannot be made or read, as in the command ``check``.

        Args:
            camera: width and height in px of the camera whose picture the pattern fills.
            read: also draw and read the pads that laser, mold and print would make.
            preset: see ``SequenceOptions``.
        """
        return check_products(self, self.layout, pixels_of("camera", camera), read=read, preset=preset)

    def write(
        self,
        folder: str | Path = "out",
        products: str | Iterable[str] = USUAL_NAMES,
        camera: tuple[int, int] = CAMERA_PX,
        preset: Preset = "balanced",
    ) -> Built:
        """Write the design's files, as the command ``build`` does.

        Args:
            folder: folder for the files; made if missing. Files of earlier builds that do not belong to this design
                are removed, unless they were changed.
            products: products to make: svg, layout, preview, report, laser, mold, mesh, print.
            camera, preset: see ``check``; pads of lasers, molds and prints are read as this camera sees them.

        Raises:
            CmpDesignError: an unknown product, or a product that cannot be made; no file is written.
            OutputError: a file cannot be written.
        """
        names = chosen_products(products if isinstance(products, str) else ",".join(products))
        return build_files(self, self.layout, folder, names, pixels_of("camera", camera), preset=preset)

    def __repr__(self) -> str:
        given = ", ".join(
            f"{name}={getattr(self, name):.6g}"
            for name in ("pitch_mm", "layers", "width_mm", "height_mm")
            if getattr(self, name) is not None
        )
        return f"<Design {self.name or 'without a name'!r}: {self.pattern}, {given}>"

    def __str__(self) -> str:
        return repr(self)

    def _repr_html_(self) -> str:
        """The pattern, its key figures and its findings, for notebooks."""
        report = self.report
        rows = {
            **report.figures(),
            "digest": report.digest[:12],
            **{f"{finding.severity} {i}": str(finding) for i, finding in enumerate(report.findings, 1)},
        }
        cells = "".join(f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in rows.items())
        drawing = self.layout._repr_svg_().partition("\n")[2]
        return f"<div><b>{escape(self.name or self.pattern)}</b><br>{drawing}<table>{cells}</table></div>"


# Without this line, ``help(Design)`` begins with three screens of the validators of its parameters.
Design.__signature__ = inspect.Signature(
    [inspect.Parameter("parameters", inspect.Parameter.VAR_KEYWORD, annotation=Any)]
)


def load(
    name_or_path: str | Path, overrides: Mapping[str, object] | None = None, /, **changes: object
) -> Design:
    """Load a design: a template's name or a TOML file, with values changed.

    Args:
        name_or_path: a template's name ("tac3d"; ``cmpdesign.templates()`` lists them) or the path of a TOML file.
        overrides: values by name, as after ``--set``; "laser.kerf_mm" names a value of a table.
        changes: the same as keywords: ``load("tac3d", layers=8, laser={"kerf_mm": 0.14})``. None removes a value.

    Raises:
        DesignError: no such template or file, not TOML, or a parameter that ``Design`` refuses.

    >>> load("honeycomb", pitch_mm="60mil", layers=3)
    <Design 'honeycomb': honeycomb, pitch_mm=1.524, layers=3>
    """
    return Design.of(load_design(name_or_path, {**(overrides or {}), **changes}))
