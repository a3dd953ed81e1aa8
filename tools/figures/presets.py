"""The table of presets in docs/explanation/extractor.md, from the schedules that the reader follows."""

from __future__ import annotations

from extractor.presets import SCHEDULES

BEGIN, END = "<!-- presets: written by python -m tools.figures -->", "<!-- end of presets -->"


def filled(text: str) -> str:
    """The page with its table replaced.

    Raises:
        ValueError: the page has no place for the table.
    """
    before, found, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (found and end):
        raise ValueError("docs/explanation/extractor.md has no place for the table of presets")
    return f"{before}{BEGIN}\n\n{table()}\n\n{END}{after}"


def table() -> str:
    """One row a preset."""
    rows = [
        "| preset | rows across a gridline | image reduced to a blur of | no step follows one that leaves |",
        "|---|---|---|---|",
    ]
    for preset, schedule in SCHEDULES.items():
        name = f"`{preset}` (default)" if preset == "balanced" else f"`{preset}`"
        left = f"{schedule.small_remainder:g} standard deviations"
        rows.append(f"| {name} | {schedule.max_profile_rows} | {schedule.reduction_blur_px:g} px | {left} |")
    return "\n".join(rows)
