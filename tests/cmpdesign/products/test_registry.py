"""The registry of products: choosing, making, and the lines of a product in the report and in messages."""

from __future__ import annotations

import json
import sys
from types import ModuleType

import cv2
import numpy as np
import pytest

from cmpdesign.design.design import Design, load_design
from cmpdesign.errors import CmpDesignError
from cmpdesign.layout.checks import Finding
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.report import design_report
from cmpdesign.products import registry as products
from cmpdesign.products.drawing.preview import draw_preview
from cmpdesign.products.registry import (
    PRODUCTS,
    USUAL_NAMES,
    PreparedProduct,
    Product,
    ProductFiles,
    chosen_products,
    make_products,
)
from tests.support.layouts import small_layout

FINDING = Finding("glue", 1.0, 2.0, "mm", "use more", "warning")


@pytest.fixture
def with_ruler(monkeypatch: pytest.MonkeyPatch) -> None:
    """A product as another module would add it: one line in the registry, one function."""

    def ruler(design: Design, layout: Layout) -> PreparedProduct:
        files = {"ruler/ruler.txt": design.pattern}
        return PreparedProduct(lambda: ProductFiles(files, {"ticks": len(layout.edges)}, (FINDING,)))

    module = ModuleType("ruler")
    module.ruler = ruler  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "ruler", module)
    monkeypatch.setattr(products, "PRODUCTS", {"ruler": Product("ruler:ruler", "ruler/"), **PRODUCTS})


def make(only: str) -> tuple[dict[str, str | bytes], tuple[Finding, ...]]:
    design, layout = load_design("honeycomb", {"layers": "2"}), small_layout()
    made = make_products(chosen_products(only), design, layout, design_report(design, layout))
    return made.files, made.findings


def test_usual_products_are_files_of_their_names() -> None:
    files, findings = make(USUAL_NAMES)
    assert list(files) == [PRODUCTS[name].where for name in USUAL_NAMES.split(",")]
    assert findings == ()


def test_a_product_brings_its_figures_and_findings(with_ruler: None) -> None:
    files, findings = make("ruler")
    assert files["ruler/ruler.txt"] == "honeycomb"
    assert json.loads(files["report.json"])["ruler"] == {"ticks": len(small_layout().edges)}
    assert findings == (FINDING,)


def test_pictures_of_a_product_are_shown_in_the_preview(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside and below the pattern's drawing, which stays as it is; the preview comes with them, unasked."""
    tall, wide = np.zeros((400, 200, 3), np.uint8), np.full((200, 400, 3), (0, 0, 255), np.uint8)
    module = ModuleType("camera")
    # type: ignore[attr-defined]
    product = ProductFiles({"a.txt": ""}, pictures={"tall": tall, "wide": wide})
    module.make = lambda design, layout: PreparedProduct(lambda: product)
    monkeypatch.setitem(sys.modules, "camera", module)
    monkeypatch.setattr(products, "PRODUCTS", {**PRODUCTS, "camera": Product("camera:make", "a.txt")})
    files, _ = make("camera")
    assert set(files) == {"a.txt", "preview.png"}
    data = files["preview.png"]
    assert isinstance(data, bytes)
    image, plain = cv2.imdecode(np.frombuffer(data, np.uint8), 1), draw_preview(small_layout())
    height, width = plain.shape[:2]
    np.testing.assert_array_equal(image[:height, :width], plain)
    assert (image[:height, width:] == 0).all(axis=2).mean() > 0.9
    assert (image[height:] == (0, 0, 248)).all(axis=2).sum() > 10_000
    again, _ = make("camera")
    assert again == files


def test_choosing() -> None:
    assert chosen_products("report , svg,svg") == ["svg", "report"]
    with pytest.raises(CmpDesignError, match="products mould: unknown; there are svg"):
        chosen_products("mould")
