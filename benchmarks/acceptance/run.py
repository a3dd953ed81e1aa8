"""Wrong positions against lost markers, over the threshold by which the reader accepts markers.

    python -m benchmarks.acceptance [--pictures N] [--seed S] [--threshold NAME] [--publish]

Pictures of random damage, and four of the suites stress and camera each for every 21 of them, are drawn once and read
at every value of the threshold. "wrong" are positions more than half of the shortest edge off, "95 % below" is their
one-sided bound by Clopper and Pearson, "lost" are visible markers that are not reported. A value holds if no id is
wrong, the bound is at most 10 in a million, and at most 5 % more are lost than at the reader's own value. Without a
seed, that of the commit's hash is taken. A bound of 10 in a million needs 300,000 reported markers without a wrong
one, which is a thousand pictures.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from benchmarks.acceptance.points import Point, pooled_point
from benchmarks.acceptance.report import NAME, curve_table, documentation_blocks
from benchmarks.frame.conditions import commit_seed, conditions_text
from benchmarks.suites.ablation.pictures import KeptPicture, keep_cases, keep_pictures, random_damage_cases
from benchmarks.suites.ablation.trial import read_changed, score_reading
from benchmarks.suites.code_copy import ROOT, CodeCopy, Replacement
from benchmarks.suites.stress.frames import PATTERNS
from benchmarks.suites.stress.random_damage import RANDOM_KINDS
from benchmarks.support.command import publishing_parser, wide_console, write_json, write_published

PICTURES, QUICK_PICTURES = 1050, 21
OTHERS_A_DRAW = 4  # pictures of stress and of camera each, for one of damage of every kind and pattern
PRESET = "balanced"
WIDTH = 110


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
        return f"    {self.field}: float = "

    def own_value(self) -> float:
        """The reader's own value."""
        text = (ROOT / self.file).read_text(encoding="utf-8")
        found = re.findall(rf"^{re.escape(self.line)}([\d.]+)$", text, re.MULTILINE)
        if len(found) != 1:
            raise ValueError(f"{self.file}: {self.field} is set {len(found)} times, not once")
        return float(found[0])

    def change(self, value: float) -> Replacement:
        """What gives the reader another value."""
        return Replacement(self.file, f"{self.line}{self.own_value():g}\n", f"{self.line}{value:g}\n")


THRESHOLDS = {
    "max_distance": Threshold(
        "extractor/complete/consistency_filter.py", "max_distance", (0.06, 0.1, 0.25, 0.4, 1.0)
    ),
    "max_deviation": Threshold("extractor/refine/acceptance.py", "max_deviation", (0.01, 0.02, 0.06, 0.15)),
    "max_shift": Threshold("extractor/refine/acceptance.py", "max_shift", (0.1, 0.18, 0.4, 0.8)),
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


def main(arguments: list[str] | None = None) -> int:
    """Draw the pictures, read them at every value, print the table and publish it if asked."""
    parser = publishing_parser(NAME, __doc__, "pictures")
    parser.add_argument("--pictures", type=int, default=PICTURES, metavar="N", help="of damage")
    parser.add_argument("--seed", type=int, metavar="S", help="of all random choices")
    parser.add_argument("--threshold", choices=tuple(THRESHOLDS), default="max_distance")
    options = parser.parse_args(arguments)
    count = QUICK_PICTURES if options.quick else options.pictures
    if count < 1:
        parser.error(f"--pictures is {count}; it must be 1 or more")
    try:
        seed = commit_seed() if options.seed is None else options.seed
    except ValueError as error:
        parser.error(str(error))
    if seed < 0:
        parser.error(f"--seed is {seed}; it must be 0 or more")
    threshold = THRESHOLDS[options.threshold]
    own_value = threshold.own_value()
    values = sorted({*threshold.values, own_value})
    with tempfile.TemporaryDirectory() as folder:
        pictures = list(keep_all(count, seed, Path(folder)))
        points = list(curve(threshold, values, pictures))
    own = next(one for one in points if one.threshold == own_value)
    console = wide_console(WIDTH)
    console.print(curve_table(points, own))
    console.print(f"{threshold.field}, {len(pictures)} pictures, seed {seed}, {PRESET}")
    console.print(conditions_text(), style="dim", soft_wrap=True)
    command = f"python -m benchmarks.{NAME} --pictures {count} --seed {seed} --threshold {options.threshold}"
    measured = {
        "command": command,
        "field": threshold.field,
        "own": own_value,
        "pictures": len(pictures),
        "points": [one._asdict() for one in points],
    }
    if options.json:
        write_json(options.json, measured)
    if options.publish:
        for path in write_published(NAME, measured, documentation_blocks(measured)):
            console.print(f"wrote {path.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
