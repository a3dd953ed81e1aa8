"""The effect of each rule of the reader: every rule switched off in a copy of the reader, over the same pictures.

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

import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

from benchmarks.ablation.report import comparison_row, merged, page, rules_table, times_table
from benchmarks.frame.experiment import COMMIT, Experiment, Found, OptionError, Shown
from benchmarks.suites.ablation.comparison import Comparison, compare
from benchmarks.suites.ablation.pictures import POOLED, PROVOKING, KeptPicture, keep_pictures
from benchmarks.suites.ablation.rules import BY_NAME, RULES, Kind, Rule
from benchmarks.suites.ablation.trial import PictureScore, read_without
from benchmarks.suites.code_copy import CodeCopy
from extractor.presets import Preset

SUITES: dict[Kind, tuple[str, ...]] = {
    "accuracy": POOLED,
    "errors and time": POOLED,
    "no wrong id": (PROVOKING,),
}
TOGETHER: tuple[Kind, ...] = ("accuracy", "no wrong id")  # whose pictures are of different suites


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


def measure(
    rule: tuple[str, ...] = (),
    together: bool = False,
    kind: str = "",
    preset: Preset = "balanced",
    pictures: int = 60,
    seed: int = COMMIT,
    processes: int = 1,
    list: bool = False,
) -> Shown:
    """Draw the pictures, read them with the full reader and without each rule.

    Args:
        rule: names of rules; all by default.
        together: switch the rules off all at once.
        kind: with --together, only in the pictures for rules of this kind.
        pictures: of each suite.
        processes: rules tried at the same time.
        list: print the rules, try none.
    """
    unknown = [name for name in rule if name not in BY_NAME] or (
        [kind] if kind not in ("", *TOGETHER) else []
    )
    if unknown:
        raise OptionError(
            f"{unknown[0]!r} is unknown; --list prints the rules, the kinds are {', '.join(TOGETHER)}"
        )
    if kind and not together:
        raise OptionError("--kind is for --together; a single rule has a kind of its own")
    rules = [BY_NAME[name] for name in rule] or [*RULES]
    if list:
        yield from (f"{one.name:<22}{one.stage:<11}{one.kind:<13}{one.purpose}" for one in rules)
        return Found()
    kinds = [kind] if kind else [*TOGETHER] if together else [one.kind for one in rules]
    suites = dict.fromkeys(suite for one in kinds for suite in SUITES[one])
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        kept = [one for suite in suites for one in keep_pictures(suite, pictures, seed, Path(folder))]
        comparisons: Iterable[Comparison] = (
            try_together(rules, kinds, kept, preset)
            if together
            else try_rules(rules, kept, preset, processes)
        )
        for comparison in comparisons:
            rows.append({**comparison_row(comparison), "seed": seed})
            yield f"{comparison.rule.name}: {comparison.verdict}"
    yield rules_table(rows)
    yield times_table(rows)
    yield f"{len(kept)} pictures"
    return Found({"seed": seed, "rows": rows})


main = Experiment("ablation", measure, page, merged, published_options=("rule", "preset", "pictures", "seed"))
main.run_as(__name__)
