"""Files of designs: ``build``, ``check``, ``init``, ``schema`` and ``templates`` of the command line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cmpdesign import documents
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.options import Preset, Written
from cmpdesign.products.registry import USUAL_NAMES

if TYPE_CHECKING:
    from cmpdesign.api.designs import Design
    from cmpdesign.design.design import Design as Parameters

CAMERA_PX = (640, 480)
TemplateKind = Literal["designs", "scenes", "plans", "machines", "materials", "silicones", "sensors"]


def build(
    design: str | Path | Parameters,
    output: Annotated[str | Path, Written(metavar="FOLDER")] = "out",
    *,
    overrides: Annotated[
        Mapping[str, object] | None, Written(name="--set", metavar="NAME=VALUE", example="pitch_mm=1.5mm")
    ] = None,
    products: Annotated[
        str | Iterable[str], Written(name="--only", metavar="NAMES", with_commas=True)
    ] = USUAL_NAMES,
    camera: Annotated[tuple[int, int], Written(metavar="WxH")] = CAMERA_PX,
    preset: Preset = "balanced",
) -> documents.designs.BuildDocument:
    """Write a design's files.

    >>> cmpdesign.build("tac3d", "mine").findings

    Args:
        design: a template's name or a TOML file; or a ``Design``.
        output: folder for the files; made if missing.
        overrides: override a parameter, as in pitch_mm=60mil; may be repeated; or a mapping, as of ``load``.
        products: products to make, separated by commas: svg, layout, preview, report, laser, mold, mesh, print.
        camera: pixels of the camera whose picture the pattern fills.
        preset: see ``SequenceOptions``.

    Raises:
        CmpDesignError: an unknown product, or a product that cannot be made; no file is written.
        OutputError: a file cannot be written.
    """
    from cmpdesign.layout.report import report_values

    built = _design(design, overrides).write(output, products, camera, preset)
    return documents.designs.BuildDocument.of(
        built,
        digest=built.report.digest,
        folder=str(output),
        written=tuple(map(str, built.written)),
        removed=tuple(map(str, built.removed)),
        report={name: value for name, value in report_values(built.report).items() if name != "findings"},
        as_made={name: reading.figures() for name, reading in built.readings.items()},
    )


def check(
    design: str | Path | Parameters,
    *,
    overrides: Annotated[
        Mapping[str, object] | None, Written(name="--set", metavar="NAME=VALUE", example="pitch_mm=1.5mm")
    ] = None,
    camera: Annotated[tuple[int, int], Written(metavar="WxH")] = CAMERA_PX,
    read: bool = False,
    preset: Preset = "balanced",
) -> documents.designs.CheckDocument:
    """List the features of a design that cannot be made or read.

    Args:
        design, overrides, camera, preset: see ``build``.
        read: draw and read the pads that laser, mold and print would make.
    """
    chosen = _design(design, overrides)
    checked = chosen.check(camera, read=read, preset=preset)
    return documents.designs.CheckDocument.of(
        checked,
        digest=chosen.layout.digest,
        passed=checked.works,
        as_made={name: reading.figures() for name, reading in checked.readings.items()},
        not_read=checked.unread,
    )


def _design(given: str | Path | Parameters, overrides: Mapping[str, object] | None) -> Design:
    from cmpdesign.api.designs import Design, load

    if isinstance(given, str | Path):
        return load(given, overrides)
    return Design.of(given).changed(**overrides) if overrides else Design.of(given)


def init(
    name: str | Path,
    *,
    extends: Annotated[str | None, Written(metavar="DESIGN")] = None,
    sensor: Annotated[str | Path | None, Written(metavar="LAYOUT")] = None,
    camera: Annotated[Sequence[str | Path], Written(metavar="FILE")] = (),
    force: bool = False,
) -> documents.designs.InitDocument:
    """Write a commented design file, or a sensor file.

    >>> cmpdesign.init("mine").written
    'mine.toml'

    Args:
        name: name of the design; NAME.toml is written. May name a folder.
        extends: begin with another design: a template's name, or the path of a file, relative to ``name``'s folder;
            None: a honeycomb of 10 layers.
        sensor: write a sensor file instead, for the pad of this layout.
        camera: of a sensor, the file of calibrate camera for each view; the same one twice for two mirrors.
        force: replace a file of this name.

    Raises:
        CmpDesignError: the file exists, or arguments that exclude each other.
        OutputError: the file cannot be written.
    """
    from cmpdesign.design.commented_toml import commented_toml
    from cmpdesign.design.extends import require_extended
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
    return documents.designs.InitDocument(written=str(file), extends=extends)


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


def schema(command: str = "") -> dict[str, Any]:
    """The JSON Schema of a design's TOML file, for editors, or of the document that a command prints with ``--json``.

    Args:
        command: words of a command, as "evaluate designs"; "message": the lines on stderr; empty: a design's TOML file.

    Raises:
        CmpDesignError: no such command.
    """
    from cmpdesign.design.design import design_schema
    from cmpdesign.documents.registry import document_schema

    return document_schema(command) if command else design_schema()


def templates(
    kind: TemplateKind | None = None, show: Annotated[str | None, Written(metavar="NAME")] = None
) -> documents.designs.TemplatesDocument | documents.designs.TemplateDocument:
    """List or show the templates.

    >>> [one.name for one in cmpdesign.templates("scenes").templates]

    Args:
        kind: list templates of one kind; None: all.
        show: print the TOML file of a template; as "sensors/tac3d" where two kinds share a name.

    Raises:
        DesignError: no such template.
    """
    from cmpdesign.design.templates import find_template, template_kinds, template_words
    from cmpdesign.inputs.files import read_text

    if show is not None:
        found, path = find_template(show if kind is None or "/" in show else f"{kind}/{show}")
        return documents.designs.TemplateDocument(kind=found, name=path.stem, text=read_text(path))
    listed = [
        {"kind": each, "name": name, **template_words(path)._asdict()}
        for each, names in template_kinds().items()
        if kind in (None, each)
        for name, path in names.items()
    ]
    return documents.designs.TemplatesDocument.model_validate({"templates": listed})
