"""The registry of products, and the function that makes them.

A product is added by one line in ``PRODUCTS``. The line names the product's maker as "module:function", so that
the module is imported only when the product is made. A maker takes ``(design, layout)``, checks what can be checked
before a file is drawn, and returns ``PreparedProduct``: the pad that the product makes, and the product when it is
asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.watch import begin

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cmpdesign.design.design import Design
    from cmpdesign.layout.checks import Finding
    from cmpdesign.layout.layout import Layout
    from cmpdesign.layout.report import DesignReport
    from cmpdesign.products.as_made.made_pad import MadePad
    from cmpdesign.products.as_made.reading import PadReading
    from extractor.presets import Preset


@dataclass(frozen=True)
class ProductFiles:
    """A product.

    Attributes:
        files: path relative to the output folder, with "/" -> content; the same bytes for the same design.
        figures: measures of the product as JSON values; the product's member in ``report.json``.
        findings: errors and warnings about the product.
        pictures: name -> (H, W, 3) uint8 BGR picture of the product, shown in ``preview.png``.
    """

    files: Mapping[str, str | bytes]
    figures: Mapping[str, Any] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    pictures: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PreparedProduct:
    """A product that can be made.

    Attributes:
        make: makes the product; a ``CmpDesignError`` where a check needs the drawing and fails.
        made_pad: the pad that the product makes; the pad is read before the files are written; None without a pad.
    """

    make: Callable[[], ProductFiles]
    made_pad: MadePad | None = None


# The camera that reads a pad, unless another one is given.
CAMERA_PX = (640, 480)
Maker = Callable[["Design", "Layout"], PreparedProduct]


@dataclass(frozen=True, eq=False)
class MadeProducts:
    """The results of ``make_products``.

    Attributes:
        files: all files by relative path, in the registry's order.
        findings: findings of the products and of the reading of their pads.
        readings: name of a product -> the extractor's reading of its pad.
    """

    files: dict[str, str | bytes]
    findings: tuple[Finding, ...]
    readings: Mapping[str, PadReading]


@dataclass(frozen=True)
class Product:
    """One entry of the registry.

    Attributes:
        maker: "module:function" of the ``Maker``.
        where: the file or folder that the product writes; a folder ends with "/".
        usual: True if a plain ``build`` makes the product; other products are made when they are named.
        has_pad: the product makes a pad, and no other product before it makes the same.
    """

    maker: str
    where: str
    usual: bool = False
    has_pad: bool = False


PREVIEW, REPORT, AS_MADE = "preview", "report", "as_made"
PRODUCTS: Mapping[str, Product] = {
    "svg": Product("cmpdesign.products.registry:_make_svg", "pattern.svg", usual=True),
    "layout": Product("cmpdesign.products.registry:_make_layout", "layout.json", usual=True),
    # The preview and the report are no ``Maker``s: they show the pictures and figures of the other products.
    PREVIEW: Product("cmpdesign.products.drawing.preview:preview_png", "preview.png", usual=True),
    "laser": Product("cmpdesign.products.laser.make:prepare_laser", "laser/", has_pad=True),
    "mold": Product("cmpdesign.products.mold.make:prepare_mold", "mold/", has_pad=True),
    "mesh": Product("cmpdesign.products.mold.meshes:prepare_meshes", "mesh/"),
    "print": Product("cmpdesign.products.sheet.print_sheet:prepare_print_sheet", "print/", has_pad=True),
    REPORT: Product("cmpdesign.layout.report:report_to_json", "report.json", usual=True),
}
USUAL_NAMES = ",".join(name for name, product in PRODUCTS.items() if product.usual)


def chosen_products(only: str) -> list[str]:
    """Parse the names in a text such as "svg, layout".

    Returns:
        The names in the registry's order, each once.

    Raises:
        CmpDesignError: a name is unknown, or the text has no name.
    """
    names = [name.strip() for name in only.split(",") if name.strip()]
    for name in names:
        if name not in PRODUCTS:
            raise CmpDesignError(f"{parameter('products')} {name}: unknown; there are {', '.join(PRODUCTS)}")
    if not names:
        raise CmpDesignError(f"{parameter('products')} names no file; there are {', '.join(PRODUCTS)}")
    return [name for name in PRODUCTS if name in names]


def product_folders() -> list[str]:
    """The folders of products, as "mold/"."""
    return [product.where for product in PRODUCTS.values() if product.where.endswith("/")]


def make_products(
    names: Sequence[str],
    design: Design,
    layout: Layout,
    report: DesignReport,
    camera_px: tuple[int, int] = CAMERA_PX,
    *,
    preset: Preset = "balanced",
) -> MadeProducts:
    """Make the named products, and read their pads in the picture of a camera of ``camera_px`` (width, height).

    ``preset`` is the preset of the extractor. Every step begins with its name, see ``cmpdesign.watch``.

    ``report.json`` is also made when a named product has figures, and ``preview.png`` when one has pictures.

    Raises:
        CmpDesignError: a product cannot be made. No file has been written.
    """
    made: dict[str, ProductFiles] = {}
    pads: dict[str, MadePad] = {}  # a mold and its meshes make the same pad
    drawn = [name for name in PRODUCTS if name in names and name not in (PREVIEW, REPORT)]
    for number, name in enumerate(drawn, start=1):
        begin(f"building {name} ({number} of {len(drawn)})" if len(drawn) > 1 else f"building {name}")
        prepared = prepare(name, design, layout)
        made[name] = prepared.make()
        if prepared.made_pad is not None:
            pads[prepared.made_pad.product] = prepared.made_pad
    pictures = {name: picture for product in made.values() for name, picture in product.pictures.items()}
    if pictures or PREVIEW in names:
        from cmpdesign.products.drawing.preview import preview_png

        made[PREVIEW] = ProductFiles({PRODUCTS[PREVIEW].where: preview_png(layout, pictures)})
    in_order = [made[name] for name in PRODUCTS if name in made]
    files = {path: content for product in in_order for path, content in product.files.items()}
    figures = {name: product.figures for name, product in made.items() if product.figures}
    findings = [finding for product in made.values() for finding in product.findings]
    readings: dict[str, PadReading] = {}
    if pads:
        from cmpdesign.products.as_made.reading import read_pads

        begin("reading of pads")
        read = read_pads(pads.values(), camera_px, preset)
        files |= read.files
        findings += read.findings
        figures[AS_MADE] = read.figures
        readings |= read.readings
    if figures or REPORT in names:
        from cmpdesign.layout.report import report_to_json

        files[PRODUCTS[REPORT].where] = report_to_json(report, figures)
    return MadeProducts(files, tuple(dict.fromkeys(findings)), readings)


def pads_as_made(design: Design, layout: Layout) -> tuple[list[MadePad], dict[str, str]]:
    """The pads of all products that make a pad, without the products' files.

    Returns:
        The pads, and for each product that cannot be made its name and the reason.
    """
    pads, reasons = [], {}
    for name, product in PRODUCTS.items():
        if not product.has_pad:
            continue
        try:
            pad = prepare(name, design, layout).made_pad
        except CmpDesignError as error:
            reasons[name] = str(error)
            continue
        assert pad is not None
        pads.append(pad)
    return pads, reasons


def refusal_of(name: str, design: Design) -> str:
    """Why a product cannot make a design's pad; "" if the product can.

    Raises:
        MissingLibraryError: a library of the product's extra is not installed.
    """
    from cmpdesign.layout.build import build_layout
    from cmpdesign.libraries import MissingLibraryError

    try:
        prepare(name, design, build_layout(design))
    except MissingLibraryError:
        raise
    except CmpDesignError as error:
        return str(error)
    return ""


def prepare(name: str, design: Design, layout: Layout) -> PreparedProduct:
    """A product of a design, checked and not yet drawn.

    Raises:
        CmpDesignError: the product cannot be made.
    """
    module, _, function = PRODUCTS[name].maker.partition(":")
    maker: Maker = getattr(import_module(module), function)
    return maker(design, layout)


def _make_svg(design: Design, layout: Layout) -> PreparedProduct:
    from cmpdesign.products.drawing.svg import layout_to_svg

    text = layout_to_svg(layout, ids=design.print_ids, scale=design.print_scale, mirror=design.print_mirror)
    return PreparedProduct(lambda: ProductFiles({PRODUCTS["svg"].where: text}))


def _make_layout(design: Design, layout: Layout) -> PreparedProduct:
    from cmpdesign.files.layout_json import layout_to_json

    return PreparedProduct(lambda: ProductFiles({PRODUCTS["layout"].where: layout_to_json(layout)}))
