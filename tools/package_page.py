"""The package's page: README with links and pictures by the project's address, and the project's addresses.

The build calls ``dynamic_metadata`` (``[tool.scikit-build.metadata]`` of pyproject.toml) in an environment
without this package's libraries.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
BRANCH = "main"
LINK = re.compile(r"\]\(([^)\s]+)\)")  # the end of a link or a picture of Markdown
PICTURES = (".jpg", ".png", ".svg")


def dynamic_metadata(field: str, settings: Mapping[str, Any]) -> Any:
    """The value of a field of ``[project]``: "readme" or "urls"."""
    address = project_address()
    if field == "urls":
        return project_urls(address)
    if field == "readme":
        text = (ROOT / "README.md").read_text(encoding="utf-8")
        return {"content-type": "text/markdown", "text": absolute_links(text, address)}
    raise ValueError(f"{field}: this plugin knows readme and urls")


def project_address() -> str:
    """The setting ``address`` of ``[tool.cmpdesign]``."""
    document = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return str(document["tool"]["cmpdesign"]["address"])


def project_urls(address: str) -> dict[str, str]:
    """The addresses that stand beside the page."""
    return {
        "Homepage": address,
        "Changelog": f"{address}/blob/{BRANCH}/CHANGELOG.md",
        "Documentation": f"{address}/tree/{BRANCH}/docs",
        "Issues": f"{address}/issues",
        "Source": address,
    }


def absolute_links(text: str, address: str) -> str:
    """Markdown whose links and pictures to files of the project are full addresses; links within the page are kept."""

    def whole(match: re.Match[str]) -> str:
        target = match[1]
        if re.match(r"[a-z]+:|#", target):
            return match[0]
        return f"]({address}/{'raw' if target.endswith(PICTURES) else 'blob'}/{BRANCH}/{target})"

    return LINK.sub(whole, text)
