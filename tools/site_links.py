"""A hook of MkDocs: files outside docs/ that pages link to become part of the site, below project/.

The pages' links are those that also hold in the repository, as in ``../../extractor/layout.schema.json``. MkDocs
refuses links out of its folder; here they lead to the copy in the site. A file's name after a fence's language becomes
the block's title.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from posixpath import dirname
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
NAMED_FENCE = re.compile(r"^```(\w+) ([\w.-]+)$", re.MULTILINE)
LINK = re.compile(r"(?<=\]\()(?!https?:|#)([^)#\s]+)")


def outside_files(pages: list[Path]) -> list[Path]:
    """Files of the project, outside docs/, that the pages link to; also those that such a file links to in turn."""
    found: list[Path] = []
    waiting = list(pages)
    while waiting:
        page = waiting.pop()
        for target in LINK.findall(page.read_text(encoding="utf-8")):
            path = (page.parent / target).resolve()
            outside = path.is_file() and path.is_relative_to(ROOT) and not path.is_relative_to(DOCS)
            if outside and path not in found:
                found.append(path)
                waiting += [path] if path.suffix == ".md" else []
    return sorted(found)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files outside docs/ to the site."""
    from mkdocs.structure.files import File

    pages = [Path(file.abs_src_path) for file in files.documentation_pages() if file.abs_src_path]
    for path in outside_files(pages):
        files.append(File.generated(config, site_uri(path), abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """The page with links to the places that the files have in the site, and with titles of named blocks."""
    source = Path(str(page.file.abs_src_path))

    def placed(match: re.Match[str]) -> str:
        path = (source.parent / match[1]).resolve()
        if not path.is_file() or not path.is_relative_to(ROOT):
            return match[1]
        return os.path.relpath(site_uri(path), dirname(page.file.src_uri) or ".").replace(os.sep, "/")

    return LINK.sub(placed, NAMED_FENCE.sub(r'```\1 title="\2"', markdown))


def site_uri(path: Path) -> str:
    """The place of a file in the site."""
    if path.is_relative_to(DOCS):
        return path.relative_to(DOCS).as_posix()
    return f"project/{path.relative_to(ROOT).as_posix()}"
