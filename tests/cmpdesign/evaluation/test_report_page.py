"""The page of a report: wide tables stay within it."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from cmpdesign.evaluation.report.page import MANY_COLUMNS, ReportTable, Section, report_html


@pytest.mark.parametrize("columns", [2, MANY_COLUMNS, MANY_COLUMNS + 1, 30])
def test_a_table_cannot_run_beyond_its_page(columns: int) -> None:
    """Every table is in a box that scrolls; long names may wrap; tables of many columns have a smaller font."""
    table = ReportTable(
        "caption", [f"h{i}" for i in range(columns)], [["a-very-long-name " * 3, *["1"] * (columns - 1)]]
    )
    html = report_html("title", [Section("one", tables=[table])])
    page = ElementTree.fromstring(html.replace("<!doctype html>", "").replace('<meta charset="utf-8">', ""))
    boxes = [box for box in page.iter("div") if box.get("class") == "wide"]
    assert [child.tag for box in boxes for child in box] == ["table"] == [t.tag for t in page.iter("table")]
    assert (boxes[0][0].get("class") == "many") == (columns > MANY_COLUMNS)
    assert ".wide { overflow-x: auto; }" in html and "overflow-wrap: anywhere" in html
