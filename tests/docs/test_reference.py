"""Generated pages of the reference, and the drawings and pictures that belong to them."""

from __future__ import annotations

import re
from pathlib import Path

import cmpdesign
import extractor
from cmpdesign.design.design import Design
from extractor import Extractor, Reason
from tools.figures import api, fields, reasons
from tools.figures.pictures import failures, lengths

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def test_every_public_name_has_its_place() -> None:
    page = api.page()
    for module in (cmpdesign, extractor):
        for name in module.__all__:
            assert name.startswith("__") or f"\n### {name}\n" in page, name
    assert "at 0x" not in page, "an address in memory, which differs from run to run"


def test_every_length_is_drawn() -> None:
    drawn = b"".join(lengths.figures().values()).decode()
    for model in (Design, *fields.tables().values()):
        for name in model.model_fields:
            assert name.rpartition("_")[2] != "mm" or re.search(rf"\b{name}\b", drawn), name


def test_every_field_has_unit_range_and_default() -> None:
    assert "| `pitch_mm` | mm | a length above 0 | none |" in fields.fields()
    assert "| `power_percent` | % | a number above 0 to 100 | none |" in fields.table(
        fields.tables()["laser"]
    )
    assert "| `border_mm` | mm | a length from 0 | `1` |" in fields.fields()


def test_each_picture_gives_its_reason() -> None:
    assert {one.reason: Extractor(one.layout).extract(one.image).reason for one in failures.failures()} == {
        reason: reason for reason in Reason
    }


def test_the_pattern_of_the_pictures_is_read_where_nothing_is_wrong() -> None:
    markers = Extractor(failures.pattern_reference()).extract(failures.view())
    assert markers.reason is None and markers.counts["measured"] == len(markers.status)


def test_every_reason_is_explained_with_a_picture() -> None:
    page = (DOCS / "how-to" / "numbering-fails.md").read_text(encoding="utf-8")
    table = reasons.page()
    for reason in Reason:
        assert f"\n## {reason}\n" in page and f"(../images/reason-{reason}.jpg)" in page
        assert f"| `{reason.name}` | `{reason}` | {reason.text} |" in table


def test_every_environment_variable_is_named() -> None:
    page = (DOCS / "reference" / "environment.md").read_text(encoding="utf-8")
    read = re.compile(r"""environ(?:\.get|\.setdefault|\.pop)?[(\[]"(\w+)"|ENV\{(\w+)\}""")
    files = [path for folder in ("cmpdesign", "extractor") for path in (ROOT / folder).rglob("*.py")]
    files += [ROOT / "cmake" / name for name in ("CMakeLists.txt", "zig.cmake")]
    texts = [path.read_text(encoding="utf-8") for path in files]
    named = {name for text in texts for pair in read.findall(text) for name in pair if name}
    assert "ZIG_TARGET" in named
    assert {name for name in named if f"`{name}`" not in page} == set()
