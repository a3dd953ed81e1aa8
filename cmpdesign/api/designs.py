"""Designs loaded, checked and written: ``templates``, ``check``, ``build`` and ``schema`` of the command line."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.api.layouts import Layout, build_layout
from cmpdesign.design.design import Design as Parameters
from cmpdesign.design.design import design_schema, load_design
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.layout.checks import CAMERA_PX
from cmpdesign.products.building import Built, Checked, build_files, check_products
from cmpdesign.products.registry import USUAL_NAMES, chosen_products

if TYPE_CHECKING:
    from cmpdesign.documents.designs import InitDocument
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

    def check(self, camera: tuple[int, int] = CAMERA_PX, *, read: bool = False) -> Checked:
        """The features that cannot be made or read, as in the command ``check``.

        Args:
            camera: width and height in px of the camera whose picture the pattern fills.
            read: also draw and read the pads that laser, mold and print would make.
        """
        return check_products(self, self.layout, _checked_camera(camera), read=read)

    def write(
        self,
        folder: str | Path = "out",
        products: str | Iterable[str] = USUAL_NAMES,
        camera: tuple[int, int] = CAMERA_PX,
    ) -> Built:
        """Write the design's files, as the command ``build`` does.

        Args:
            folder: folder for the files; made if missing. Files of earlier builds that do not belong to this design
                are removed, unless they were changed.
            products: products to make: svg, layout, preview, report, laser, mold, mesh, print.
            camera: see ``check``; pads of lasers, molds and prints are read as this camera sees them.

        Raises:
            CmpDesignError: an unknown product, or a product that cannot be made; no file is written.
            OutputError: a file cannot be written.
        """
        names = products if isinstance(products, str) else ",".join(products)
        return build_files(self, self.layout, folder, chosen_products(names), _checked_camera(camera))

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
            "pattern": f"{report.pattern}, {report.layers} layers, pitch {report.pitch_mm:.4g} mm",
            "markers": str(report.present_markers),
            "size": "{:.2f} x {:.2f} mm".format(*report.size_mm),
            "smallest feature": f"{report.smallest_feature_mm:.3f} mm",
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


def build(
    design: str | Path | Parameters,
    output: str | Path = "out",
    *,
    products: str | Iterable[str] = USUAL_NAMES,
    camera: tuple[int, int] = CAMERA_PX,
) -> Built:
    """Write a design's files, as the command ``build`` does; see ``Design.write``.

    >>> cmpdesign.build("tac3d", "mine").findings
    """
    return _design(design).write(output, products, camera)


def check(
    design: str | Path | Parameters, *, camera: tuple[int, int] = CAMERA_PX, read: bool = False
) -> Checked:
    """The features of a design that cannot be made or read, as the command ``check`` lists them."""
    return _design(design).check(camera, read=read)


def _design(given: str | Path | Parameters) -> Design:
    return Design.of(given) if isinstance(given, Parameters) else load(given)


def init(
    name: str | Path,
    *,
    extends: str | None = None,
    sensor: str | Path | None = None,
    camera: Sequence[str | Path] = (),
    force: bool = False,
) -> InitDocument:
    """Write a commented design file, or a sensor file, as the command ``init`` does.

    >>> cmpdesign.init("mine").written
    'mine.toml'

    Args:
        name: name of the design; NAME.toml is written. May name a folder.
        extends: design to begin with: a template's name, or a path relative to the folder of ``name``; None: a
            honeycomb of 10 layers.
        sensor: layout file of a pad: a sensor file is written instead.
        camera: files of ``calibrate_camera`` for the views of the sensor; the same one twice for two mirrors.
        force: replace a file of this name.

    Raises:
        CmpDesignError: the file exists, or arguments that exclude each other.
        OutputError: the file cannot be written.
    """
    from cmpdesign.design.commented_toml import commented_toml
    from cmpdesign.design.extends import require_extended
    from cmpdesign.documents.designs import InitDocument
    from cmpdesign.files.atomic import write_file
    from cmpdesign.inputs.files import path_exists

    file = Path(name)
    if not file.name:
        raise CmpDesignError(f"{name} is a folder; give a design's name")
    file = file if file.suffix == ".toml" else file.with_name(f"{file.name}.toml")
    if path_exists(file) and not force:
        raise CmpDesignError(
            f"{file}: exists already; choose another name, or replace it with {parameter('force')}"
        )
    if sensor is not None or camera:
        if sensor is None or not camera or extends is not None:
            words = [parameter("sensor"), parameter("camera"), parameter("extends")]
            raise CmpDesignError("a sensor file needs {} LAYOUT and {} FILE, and no {}".format(*words))
        text = _sensor_text(file, Path(sensor), [Path(one) for one in camera])
    else:
        if extends is not None:
            require_extended(extends, file)
        text = commented_toml(extends)
    write_file(file, text)
    return InitDocument(written=str(file), extends=extends)


def _sensor_text(file: Path, layout: Path, cameras: Sequence[Path]) -> str:
    """The text of a sensor file for the pad of a layout."""
    from cmpdesign.sensor.commented import relative_name, sensor_text
    from cmpdesign.sensor.sensor_file import load_sensor_file, parse_sensor_file
    from extractor import load_layout

    load_layout(layout)
    views = [load_sensor_file(one) for one in cameras]
    text = sensor_text(file.stem, relative_name(layout, file.parent), views)
    parse_sensor_file(text, str(file))
    return text


def schema() -> dict[str, Any]:
    """The JSON Schema of a design's TOML file, for editors, as the command ``schema`` prints it."""
    return design_schema()


def templates() -> dict[str, Design]:
    """The design templates by name, as the command ``templates`` lists them.

    >>> templates()["tac3d"].layers
    10
    """
    from cmpdesign.design import templates as shipped

    return {name: load(name) for name in shipped.templates()}


def _checked_camera(camera: tuple[int, int]) -> tuple[int, int]:
    """The camera's width and height.

    Raises:
        CmpDesignError: not two whole numbers of 10 px or more.
    """
    sides = tuple(camera)
    if len(sides) != 2 or not all(isinstance(side, int) and side >= 10 for side in sides):
        raise CmpDesignError(
            f"camera is {camera!r}; expected (width, height) of 10 px or more, as (640, 480)"
        )
    return sides[0], sides[1]
