"""``evaluate angles``: the deformation and rotation at which a cell is lost (the article, eqs. 1 and 2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cmpdesign.evaluation.runner import RunOptions, Trial

RECOGNITION_RULE = (
    "A cell is recognised when the n most prominent corners of its contour are convex, each by at least 1.5 px, "
    "and the outline fits these corners; a corner gets the number of the corner at rest with the nearest direction."
)
CELL_SIDES = (3, 4, 6)
EDGE_LENGTHS_PX = (20, 50, 100, 400)
STEP_DEG = 1.0  # resolution of the measured angles


def change_limit_deg(sides: int) -> float:
    """The article's eq. 1: the largest growth of a corner's inner angle in degrees."""
    return 360 / sides


def turn_limit_deg(sides: int) -> float:
    """The article's eq. 2: the largest rotation of a cell in degrees."""
    return 180 / sides


def trials(options: RunOptions) -> list[Trial]:
    """One trial for every kind of deformation, shape of cell and size. They are not random."""
    return [
        Trial(f"{kind}-{sides}-{edge_px}", {"kind": kind, "sides": sides, "edge_px": edge_px})
        for kind in ("shape", "turn")
        for sides in CELL_SIDES
        for edge_px in EDGE_LENGTHS_PX
    ]


def work(values: Mapping[str, Any]) -> dict[str, Any]:
    """The first angle, in steps of ``STEP_DEG``, at which a cell is lost."""
    from cmpdesign.evaluation.measures.single_cells import is_numbering_kept, is_shape_recognised

    holds, limit = (
        (is_shape_recognised, change_limit_deg)
        if values["kind"] == "shape"
        else (is_numbering_kept, turn_limit_deg)
    )
    sides, edge_px = int(values["sides"]), float(values["edge_px"])
    return {"first_lost_deg": first_lost_deg(lambda angle: holds(sides, edge_px, angle), limit(sides) + 30)}


def first_lost_deg(holds: Callable[[float], bool], until_deg: float) -> float | None:
    """The first angle from 0, in steps of ``STEP_DEG``, at which the condition fails; None if it never fails."""
    for number in range(int(until_deg / STEP_DEG) + 1):
        if not holds(number * STEP_DEG):
            return number * STEP_DEG
    return None


def figures(trials: Sequence[Trial], results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The members of report.json: by number of sides, the formula's limits and the measured limits by edge length."""
    document: dict[str, Any] = {}
    for trial, result in zip(trials, results, strict=True):
        sides = trial.values["sides"]
        cell = document.setdefault(
            f"n{sides}",
            {
                "shape_change_deg": {"formula": change_limit_deg(sides), "measured": {}},
                "rotation_deg": {"formula": turn_limit_deg(sides), "measured": {}},
            },
        )
        name = "shape_change_deg" if trial.values["kind"] == "shape" else "rotation_deg"
        cell[name]["measured"][f"{trial.values['edge_px']}px"] = result["first_lost_deg"]
    return {"rule": RECOGNITION_RULE, "cells": document}
