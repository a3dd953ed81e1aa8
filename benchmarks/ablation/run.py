"""The effect of each rule of the reader: every rule switched off in a copy of the reader, over the same pictures.

    python -m benchmarks.ablation [--rule NAME ...] [--together [--kind KIND]] [--preset NAME] [--pictures N] [--seed S]

A rule for accuracy is tried on the suites plain, stress, damage, scatter, camera, views and traced together; a rule
whose purpose is that no wrong id is reported, on pictures made to provoke wrong ids. A rule stays if it saves a wrong
id, or if without it wrong markers, lost markers or the RMS of measured markers rise by 2 % or more, with a paired 95 %
interval above zero (bootstrap over pictures). A rule for true errors or for time stays, too, if z goes as far from 1,
or if the share of markers beyond three deviations or the processor time rise so. Without a seed, that of the commit's
hash is taken.

Wrong ids are at another marker's place, or in a picture without the pattern; wrong positions are more than half of the
shortest edge off. RMS is of all measured markers together, "typical" the geometric mean of the pictures' own RMS; both
are judged. Differences are "without the rule" minus "with it". z is of all reported markers, time the ratio of
processor times. Two rules may replace each other: with ``--together`` all named rules are switched off at once, in
the pictures of both kinds, or of one ``--kind``. Rules in C++ need a compiler: every process builds a copy of the
reader once, and for each such rule compiles the changed file.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

from benchmarks.ablation.report import comparison_row, publish
from benchmarks.frame.conditions import commit_seed, conditions_text
from benchmarks.suites.ablation.comparison import Change, Comparison, compare
from benchmarks.suites.ablation.pictures import POOLED, PROVOKING, KeptPicture, keep_pictures
from benchmarks.suites.ablation.rule import Kind, Rule
from benchmarks.suites.ablation.rules import BY_NAME, RULES
from benchmarks.suites.ablation.trial import PictureScore, read_without
from benchmarks.suites.code_copy import CodeCopy
from benchmarks.support.command import write_json
from extractor.presets import PRESETS

SUITES: dict[Kind, tuple[str, ...]] = {
    "accuracy": POOLED,
    "errors and time": POOLED,
    "no wrong id": (PROVOKING,),
}
TOGETHER: tuple[Kind, ...] = ("accuracy", "no wrong id")  # whose pictures are of different suites
PICTURES = 60  # of each suite
HEAD = (
    f"{'rule':<22}{'stage':<11}{'kind':<13}{'pictures':>9}{'touched':>8}{'ids':>9}{'positions':>10}"
    f"{'lost':>8}{'difference, 95 %':>27}{'RMS px':>9}{'difference in %, 95 %':>27}{'typical':>9}"
    f"{'difference in %, 95 %':>27}{'z':>12}{'beyond %':>12}{'time':>6}  verdict"
)


def scores_by_suite(
    rules: Sequence[Rule], pictures: Sequence[KeptPicture], preset: str, copy: CodeCopy
) -> dict[str, list[PictureScore]]:
    """The scores without the rules, by suite."""
    found: dict[str, list[PictureScore]] = {picture.suite: [] for picture in pictures}
    for picture, score in zip(pictures, read_without(rules, pictures, preset, copy), strict=True):
        found[picture.suite].append(score)
    return found


def try_rules(
    rules: Sequence[Rule], pictures: Sequence[KeptPicture], preset: str, processes: int
) -> Iterable[Comparison]:
    """The comparison of each rule on the pictures of its kind, as soon as it is computed, in the order of the rules.

    Each process has its own copy of the reader. If a rule is native, all copies are built from their sources.
    """
    full: dict[str, list[PictureScore]] = {}
    idle: SimpleQueue[CodeCopy] = SimpleQueue()

    def try_rule(rule: Rule) -> Comparison:
        own = [picture for picture in pictures if picture.suite in SUITES[rule.kind]]
        copy = idle.get()
        try:
            # what else the machine does must not count: the time of the full reader is taken anew
            before = scores_by_suite((), own, preset, copy) if rule.kind == "errors and time" else full
            without = scores_by_suite((rule,), own, preset, copy)
        finally:
            idle.put(copy)
        suites = list(without)
        return compare(
            rule,
            [score for suite in suites for score in before[suite]],
            [score for suite in suites for score in without[suite]],
        )

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(processes) as pool:
        copies = [CodeCopy(Path(folder) / str(number)) for number in range(processes)]
        for copy in copies:
            if any(rule.change.is_native for rule in rules):
                copy.build()
            idle.put(copy)
        full |= scores_by_suite((), pictures, preset, copies[0])
        yield from pool.map(try_rule, rules)


def try_together(
    rules: Sequence[Rule], kinds: Iterable[Kind], pictures: Sequence[KeptPicture], preset: str
) -> Iterable[Comparison]:
    """For the suites of each kind, the comparison of the reader without all of the rules, named after the first."""
    with tempfile.TemporaryDirectory() as folder:
        copy = CodeCopy(Path(folder) / "copy")
        if any(rule.change.is_native for rule in rules):
            copy.build()
        for kind in kinds:
            suites = SUITES[kind]
            own = [picture for picture in pictures if picture.suite in suites]
            full, without = (read_without(some, own, preset, copy) for some in ((), rules))
            yield compare(
                rules[0]._replace(name=f"{rules[0].name} + {len(rules) - 1}", kind=kind), full, without
            )


def comparison_line(found: Comparison) -> str:
    """The line of a rule below ``HEAD``."""
    return (
        f"{found.rule.name:<22}{found.rule.stage:<11}{found.rule.kind:<13}{found.pictures:>9}{found.touched:>8}"
        f"{_pair(found.wrong_ids):>9}{_pair(found.wrong_positions):>10}"
        f"{found.lost.full:>8.0f}{_interval(found.lost, 1.0, 0):>27}"
        f"{found.rms_px.full:>9.4f}{_interval(found.rms_px, 100 / found.rms_px.full, 2):>27}"
        f"{found.typical_px.full:>9.4f}{_interval(found.typical_px, 100 / found.typical_px.full, 2):>27}"
        f"{found.z[0]:>6.2f}>{found.z[1]:.2f}"
        f"{100 * found.beyond.full:>7.2f}>{100 * found.beyond.without:.2f}{found.time_ratio:>7.2f}  {found.verdict}"
    )


def _pair(counts: tuple[int, int]) -> str:
    return f"{counts[0]}>{counts[1]}"


def _interval(change: Change, unit: float, digits: int) -> str:
    """The difference and its interval, times the unit."""
    value, low, high = (unit * number for number in (change.difference, change.low, change.high))
    return f"{value:+.{digits}f} [{low:+.{digits}f}, {high:+.{digits}f}]"


def main(arguments: list[str] | None = None) -> int:
    """Draw the pictures, read them with the full reader and without each rule, print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.ablation", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument(
        "--rule", action="append", choices=tuple(BY_NAME), metavar="NAME", help="all by default"
    )
    parser.add_argument("--together", action="store_true", help="switch the rules off all at once")
    parser.add_argument(
        "--kind", choices=TOGETHER, help="with --together, only in the pictures for rules of this kind"
    )
    parser.add_argument("--preset", choices=tuple(PRESETS), default="balanced")
    parser.add_argument("--pictures", type=int, default=PICTURES, metavar="N", help="of each suite")
    parser.add_argument("--seed", type=int, metavar="S", help="of all random choices")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every row")
    parser.add_argument("--publish", action="store_true", help="put the rows into docs/measured and its page")
    parser.add_argument("--processes", type=int, default=1, metavar="N", help="rules tried at the same time")
    parser.add_argument("--list", action="store_true", help="print the rules, try none")
    options = parser.parse_args(arguments)
    rules = [BY_NAME[name] for name in options.rule] if options.rule else list(RULES)
    if options.list:
        print("\n".join(f"{rule.name:<22}{rule.stage:<11}{rule.kind:<13}{rule.purpose}" for rule in rules))
        return 0
    if options.pictures < 1:
        parser.error(f"--pictures is {options.pictures}; it must be 1 or more")
    try:
        seed = commit_seed() if options.seed is None else options.seed
    except ValueError as error:
        parser.error(str(error))
    if options.kind and not options.together:
        parser.error("--kind is for --together; a single rule has a kind of its own")
    if options.together and options.publish:
        parser.error("--together tells nothing of single rules; leave --publish out")
    if seed < 0:
        parser.error(f"--seed is {seed}; it must be 0 or more")
    started, found = time.perf_counter(), []
    kinds = (
        [options.kind]
        if options.kind
        else list(TOGETHER)
        if options.together
        else [rule.kind for rule in rules]
    )
    suites = list(dict.fromkeys(suite for kind in kinds for suite in SUITES[kind]))
    with tempfile.TemporaryDirectory() as folder:
        pictures = [
            picture
            for suite in suites
            for picture in keep_pictures(suite, options.pictures, seed, Path(folder))
        ]
        print(HEAD, flush=True)
        comparisons: Iterable[Comparison] = (
            try_together(rules, kinds, pictures, options.preset)
            if options.together
            else try_rules(rules, pictures, options.preset, options.processes)
        )
        for comparison in comparisons:
            found.append(comparison)
            print(comparison_line(comparison), flush=True)
    print(f"{len(pictures)} pictures, seed {seed}, {options.preset}; {time.perf_counter() - started:.0f} s")
    print(conditions_text())
    rows = [comparison_row(comparison) for comparison in found]
    if options.json:
        write_json(options.json, {"seed": seed, "rows": rows})
    if options.publish:
        named = "".join(f' --rule "{name}"' for name in options.rule or ())
        command = f"python -m benchmarks.ablation --preset {options.preset} --pictures {options.pictures} --seed {seed}"
        for path in publish(rows, command + named, seed):
            print(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
