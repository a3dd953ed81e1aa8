"""The contacts of a scene file: one for all frames when constant, one path of increments when the object moves."""

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
    """Solve the contact of every frame.

    Args:
        tables: [contact] in every frame.
        changing: dotted paths of the values that change from frame to frame. If only the motion changes, every frame
            continues from the frame before, because friction depends on the path. Otherwise every frame starts from
            rest.
        folder: folder of height maps.

    Raises:
        SceneError: a name or a value is not allowed, or a contact cannot be solved.
    """
    from cmpdesign.contact import ContactError, contact_from, solve_path

    try:
        if not any(path.startswith("contact.") for path in changing):
            constant = contact_from(tables[0], folder).solve()
            yield from (constant for _ in tables)
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
        SceneError: a name or a value is not allowed.
    """
    from cmpdesign.contact import ContactError, contact_from

    try:
        contact_from(table, folder)
    except ContactError as error:
        raise SceneError(_contact_message(error)) from None


def _contact_message(error: Exception) -> str:
    text = str(error)
    return text if text.startswith("contact") else f"[contact] {text}"
