"""The registry of products: choosing, making, and what a product tells the report and the user."""

from __future__ import annotations

import json
import sys
from types import ModuleType

import pytest
from conftest import small_layout

from cmpdesign import products
from cmpdesign.checks import Finding
from cmpdesign.design import Design, load_design
from cmpdesign.errors import CmpDesignError
from cmpdesign.layout import Layout
from cmpdesign.products import PRODUCTS, USUAL, Made, Product, chosen_products, make_products
from cmpdesign.report import report

FINDING = Finding("glue", 1.0, 2.0, "mm", "use more", "warning")


@pytest.fixture
def with_ruler(monkeypatch: pytest.MonkeyPatch) -> None:
    """A product as another module would add it: one line in the registry, one function."""

    def ruler(design: Design, layout: Layout) -> Made:
        return Made({"ruler/ruler.txt": design.pattern}, {"ticks": len(layout.edges)}, (FINDING,))

    module = ModuleType("ruler")
    module.ruler = ruler  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "ruler", module)
    monkeypatch.setattr(products, "PRODUCTS", {"ruler": Product("ruler:ruler", "ruler/"), **PRODUCTS})


def make(only: str) -> tuple[dict[str, str | bytes], tuple[Finding, ...]]:
    design, layout = load_design("honeycomb", {"layers": "2"}), small_layout()
    return make_products(chosen_products(only), design, layout, report(design, layout))


def test_usual_products_are_files_of_their_names() -> None:
    files, findings = make(USUAL)
    assert list(files) == [PRODUCTS[name].where for name in USUAL.split(",")]
    assert findings == ()


def test_a_product_brings_its_figures_and_findings(with_ruler: None) -> None:
    files, findings = make("ruler")
    assert files["ruler/ruler.txt"] == "honeycomb"
    assert json.loads(files["report.json"])["ruler"] == {"ticks": len(small_layout().edges)}
    assert findings == (FINDING,)


def test_choosing() -> None:
    assert chosen_products("report , svg,svg") == ["svg", "report"]
    with pytest.raises(CmpDesignError, match="--only mould: unknown; there are svg"):
        chosen_products("mould")
