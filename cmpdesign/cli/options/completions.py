"""Names that shells complete: those of templates."""

from __future__ import annotations

from collections.abc import Callable, Mapping


def _names(finder: str) -> Callable[[str], list[str]]:
    def complete(incomplete: str) -> list[str]:
        from cmpdesign.design import templates

        return [name for name in getattr(templates, finder)() if name.startswith(incomplete)]

    return complete


def complete_template(incomplete: str) -> list[str]:
    """The names of all kinds of templates that begin with a text."""
    from cmpdesign.design.templates import template_kinds

    return [name for names in template_kinds().values() for name in names if name.startswith(incomplete)]


# The parameter of a call -> the names that begin with a text.
COMPLETIONS: Mapping[str, Callable[[str], list[str]]] = {
    "design": _names("templates"),
    "designs": _names("templates"),
    "extends": _names("templates"),
    "scene": _names("scene_templates"),
    "plan": _names("plan_templates"),
    "show": complete_template,
}
