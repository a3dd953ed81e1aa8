"""Wrong positions against lost markers, over the threshold by which the reader accepts markers.

Pictures of random damage, and four of the suites stress and camera each for every 21 of them, are drawn once and read
at every value of the threshold. "wrong" are positions more than half of the shortest edge off, "95 % below" is their
one-sided bound by Clopper and Pearson, "lost" are visible markers that are not reported. A value holds if no id is
wrong, the bound is at most 10 in a million, and at most 5 % more are lost than at the reader's own value. A bound of 10
in a million needs 300,000 reported markers without a wrong one, which is a thousand pictures.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from benchmarks.acceptance.points import Point, pooled_point
from benchmarks.acceptance.report import curve_table, page
from benchmarks.frame.conditions import ROOT
from benchmarks.frame.experiment import COMMIT, Experiment, Found, OptionError, Shown
from benchmarks.suites.ablation.pictures import KeptPicture, keep_cases, keep_pictures, random_damage_cases
from benchmarks.suites.ablation.trial import read_changed, score_reading
from benchmarks.suites.code_copy import CodeCopy, Replacement
from benchmarks.suites.stress.frames import PATTERNS
from benchmarks.suites.stress.random_damage import RANDOM_KINDS

QUICK_PICTURES = 21
OTHERS_A_DRAW = 4  # pictures of stress and of camera each, for one of damage of every kind and pattern
PRESET = "balanced"


class Threshold(NamedTuple):
    """A number in a ``Limits`` record.

    Attributes:
        file: of the record, relative to the checkout.
        field: of the record.
        values: that are tried besides the reader's own.
    """

    file: str
    field: str
    values: tuple[float, ...]

    @property
    def line(self) -> str:
        """The line of the file that sets it, without the number."""
        return f"  double {self.field} = "

    def own_value(self) -> float:
        """The reader's own value."""
        text = (ROOT / self.file).read_text(encoding="utf-8")
        found = re.findall(rf"^{re.escape(self.line)}([\d.]+);$", text, re.MULTILINE)
        if len(found) != 1:
            raise ValueError(f"{self.file}: {self.field} is set {len(found)} times, not once")
        return float(found[0])

    def change(self, value: float) -> Replacement:
        """What gives the reader another value."""
        return Replacement(self.file, f"{self.line}{self.own_value():g};\n", f"{self.line}{value:g};\n")


THRESHOLDS = {
    "max_distance": Threshold(
        "extractor/native/complete/consistency_filter.hpp", "max_distance", (0.06, 0.1, 0.25, 0.4, 1.0)
    ),
}


def keep_all(count: int, seed: int, folder: Path) -> Iterator[KeptPicture]:
    """Pictures of damage, as many as asked for, and those of the other suites."""
    a_draw = len(RANDOM_KINDS) * len(PATTERNS)
    damage = islice(random_damage_cases(seed, -(-count // a_draw)), count)
    yield from keep_cases("damage", damage, f"damage-{seed}", folder)
    for suite in ("stress", "camera"):
        yield from keep_pictures(suite, max(count * OTHERS_A_DRAW // a_draw, 1), seed, folder)


def curve(threshold: Threshold, values: Sequence[float], pictures: Sequence[KeptPicture]) -> Iterable[Point]:
    """A point for each value, as soon as it is known."""
    paths = [picture.path for picture in pictures]
    with tempfile.TemporaryDirectory() as folder:
        copy = CodeCopy(Path(folder))
        for value in values:
            changes = [] if value == threshold.own_value() else [threshold.change(value)]
            readings = read_changed(changes, paths, PRESET, copy)
            scores = [
                score_reading(reading, picture.truths)
                for reading, picture in zip(readings, pictures, strict=True)
            ]
            yield pooled_point(value, scores)


def measure(
    quick: bool = False, pictures: int = 1050, seed: int = COMMIT, threshold: str = "max_distance"
) -> Shown:
    """Draw the pictures, and read them at every value.

    Args:
        quick: few pictures.
        pictures: of damage.
        threshold: max_distance.
    """
    if threshold not in THRESHOLDS:
        raise OptionError(f"--threshold is {threshold!r}; it must be one of {', '.join(THRESHOLDS)}")
    tried = THRESHOLDS[threshold]
    own_value = tried.own_value()
    with tempfile.TemporaryDirectory() as folder:
        kept = list(keep_all(QUICK_PICTURES if quick else pictures, seed, Path(folder)))
        points = list(curve(tried, sorted({*tried.values, own_value}), kept))
    own = next(one for one in points if one.threshold == own_value)
    yield curve_table(points, own)
    yield f"{tried.field}, {len(kept)} pictures, {PRESET}"
    shown = [one._asdict() for one in points]
    return Found({"field": tried.field, "own": own_value, "pictures": len(kept), "points": shown})


main = Experiment("acceptance", measure, page, published_options=("pictures", "seed", "threshold"))
main.run_as(__name__)
