"""The rules of the reader, each with the text of its source that switches it off; ``rules.toml`` lists them.

A rule is a threshold, a branch or a fallback without which the reader would still work. The text occurs exactly once in
its file. A threshold is switched off in the limits of its Python module, which need no compiler. The stages themselves
(seeds, mesh, walk, registration) are no rules.
"""

from __future__ import annotations

import tomllib
from pathlib import Path, PurePosixPath
from typing import Literal, NamedTuple

from benchmarks.suites.code_copy import Replacement

Kind = Literal["accuracy", "errors and time", "no wrong id"]


class Rule(NamedTuple):
    """One rule.

    Attributes:
        name: name of the rule.
        purpose: what the rule is for.
        kind: by what it is judged: by counts and errors in the five suites, by z and processor time, too, or by the
            wrong ids that it prevents.
        file: of the reader's source, relative to the checkout.
        text: of the file, to be replaced.
        without: the text that replaces it and switches the rule off.
    """

    name: str
    purpose: str
    kind: Kind
    file: str
    text: str
    without: str

    @property
    def stage(self) -> str:
        """The folder of the reader that holds the rule, or ``pipeline``."""
        parts = PurePosixPath(self.file).with_suffix("").parts[1:]
        return parts[1] if parts[0] == "native" else parts[0]

    @property
    def change(self) -> Replacement:
        """The change that switches the rule off."""
        return Replacement(self.file, self.text, self.without)


_LISTED = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
RULES = tuple(Rule(**fields) for fields in _LISTED["rule"])
BY_NAME = {rule.name: rule for rule in RULES}
