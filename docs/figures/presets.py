"""The table of presets in docs/explanation/extractor.md, from the schedules that the reader follows."""

from __future__ import annotations

from extractor.presets import SCHEDULES

BEGIN, END = "<!-- presets: written by python -m docs.figures -->", "<!-- end of presets -->"
NUMBERS = ("no", "one", "two", "three", "four", "five", "six")


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
        "| preset | profiles | image reduced to a blur of | synthesis | no step follows a move below |",
        "|---|---|---|---|---|",
    ]
    for preset, schedule in SCHEDULES.items():
        name = f"`{preset}` (default)" if preset == "balanced" else f"`{preset}`"
        most = f"at most {NUMBERS[schedule.steps]} steps"
        profiles = "one round"
        if schedule.sharp_blur_share:
            profiles = "two rounds"
            limit = f"where the blur is above {schedule.sharp_blur_share:g} edges"
            most = f"none; {most} in the place of the second round {limit}"
        move = f"{schedule.small_move:g} standard deviations"
        rows.append(f"| {name} | {profiles} | {schedule.reduction_blur_px:g} px | {most} | {move} |")
    return "\n".join(rows)
