"""The contacts of a scene file: solved once where nothing moves, as one way where the object does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.scene.errors import SceneError

if TYPE_CHECKING:
    from cmpdesign.contact import Contact

MOTION = "contact.motion."


def solve_contacts(
    tables: Sequence[Mapping[str, Any]], changing: Sequence[str], folder: Path
) -> Iterator[Contact]:
    """The contact of every frame.

    Args:
        tables: [contact] in every frame.
        changing: dotted paths of what changes from frame to frame. If it is the motion alone, every frame goes on from
            the one before, so that friction knows the way; if it is anything else, every frame starts from rest.
        folder: where a height map is looked for.

    Raises:
        SceneError: a name or a value that is not allowed, or a contact that cannot be solved.
    """
    from cmpdesign.contact import ContactError, contact_from, solve_path

    try:
        if not any(path.startswith("contact.") for path in changing):
            found = contact_from(tables[0], folder).solve()
            yield from (found for _ in tables)
        elif all(path.startswith(MOTION) for path in changing if path.startswith("contact.")):
            setups = [contact_from(table, folder) for table in tables]
            first = setups[0]
            yield from solve_path(
                first.elastomer,
                first.indenter,
                [setup.motion for setup in setups],
                friction=first.friction,
                size_mm=first.size_mm,
                grid=first.grid,
            )
        else:
            yield from (contact_from(table, folder).solve() for table in tables)
    except ContactError as error:
        raise SceneError(_contact_message(error)) from None


def check_contact(table: Mapping[str, Any], folder: Path) -> None:
    """Read [contact] without solving it.

    Raises:
        SceneError: a name or a value that is not allowed.
    """
    from cmpdesign.contact import ContactError, contact_from

    try:
        contact_from(table, folder)
    except ContactError as error:
        raise SceneError(_contact_message(error)) from None


def _contact_message(error: Exception) -> str:
    text = str(error)
    return text if text.startswith("contact") else f"[contact] {text}"
