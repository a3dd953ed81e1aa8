"""Runs: a journal that is readable after a crash, and results that depend on neither order nor processes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.evaluation import journal
from cmpdesign.evaluation.journal import JOURNAL_NAME, Journal, fingerprint
from cmpdesign.evaluation.runner import RunOptions, Trial, run_trials, trial_rng

CONDITIONS = {"experiment": "test", "seed": 3}
TRIALS = [Trial(f"draw-{i}", {"seed": 3, "index": i}) for i in range(6)]


def drawn(values: Mapping[str, Any]) -> dict[str, Any]:
    """A trial that is nothing but its random numbers."""
    return {"value": float(trial_rng(values["seed"], "draw", values["index"]).normal())}


def interrupted(values: Mapping[str, Any]) -> dict[str, Any]:
    if values["index"] == 3:
        raise KeyboardInterrupt
    return drawn(values)


def all_of(folder: Path, work: Any = drawn, trials: list[Trial] = TRIALS, workers: int = 1) -> list[Any]:
    with Journal(folder, CONDITIONS) as kept:
        return run_trials(work, trials, kept, workers=workers)


def test_an_interrupted_run_goes_on_and_gives_the_same(tmp_path: Path) -> None:
    whole = all_of(tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        all_of(tmp_path / "cut", interrupted)
    assert len((tmp_path / "cut" / JOURNAL_NAME).read_text().splitlines()) == 4
    tried = []

    def watched(values: Mapping[str, Any]) -> dict[str, Any]:
        tried.append(values["index"])
        return drawn(values)

    assert all_of(tmp_path / "cut", watched) == whole and tried == [3, 4, 5]
    assert (tmp_path / "cut" / JOURNAL_NAME).read_bytes() == (tmp_path / "whole" / JOURNAL_NAME).read_bytes()


def test_neither_order_nor_processes_matter(tmp_path: Path) -> None:
    whole = all_of(tmp_path / "whole")
    assert all_of(tmp_path / "two", workers=2) == whole
    assert all_of(tmp_path / "back", trials=TRIALS[::-1]) == whole[::-1]
    assert len({result["value"] for result in whole}) == len(TRIALS)


@pytest.mark.parametrize("cut", range(1, 60, 7))
def test_a_line_that_a_crash_cut_short_is_dropped(tmp_path: Path, cut: int) -> None:
    whole = all_of(tmp_path)
    path = tmp_path / JOURNAL_NAME
    data = path.read_bytes()
    path.write_bytes(data[:-cut])
    assert all_of(tmp_path) == whole
    assert path.read_bytes() == data


def test_a_torn_first_line_starts_anew(tmp_path: Path) -> None:
    (tmp_path / JOURNAL_NAME).write_text('{"journal": 1, "finger')
    assert len(all_of(tmp_path)) == len(TRIALS)


def test_another_run_is_refused_and_left_alone(tmp_path: Path) -> None:
    all_of(tmp_path)
    before = (tmp_path / JOURNAL_NAME).read_bytes()
    with pytest.raises(CmpDesignError, match="other conditions"):
        Journal(tmp_path, {**CONDITIONS, "seed": 4})
    assert (tmp_path / JOURNAL_NAME).read_bytes() == before
    (tmp_path / JOURNAL_NAME).write_text("not a journal\n")
    with pytest.raises(CmpDesignError, match="is not the journal"):
        Journal(tmp_path, CONDITIONS)


def test_a_run_of_other_code_is_not_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    all_of(tmp_path, trials=TRIALS[:2])
    before = (tmp_path / JOURNAL_NAME).read_bytes()
    monkeypatch.setattr(journal, "code_digest", lambda: "0" * 64)
    with pytest.raises(CmpDesignError, match=r"begun by other code.*another folder, or remove"):
        Journal(tmp_path, CONDITIONS)
    assert (tmp_path / JOURNAL_NAME).read_bytes() == before
    (tmp_path / JOURNAL_NAME).unlink()
    assert len(all_of(tmp_path)) == len(TRIALS)


def test_the_code_digest_knows_every_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A changed line, a new file and a new name each make another digest; other packages do not count."""
    package = tmp_path / "measured_code"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "inner" / "one.py").write_text("LIMIT = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(journal, "HASHED_PACKAGES", ("measured_code",))
    digest = journal.code_digest.__wrapped__
    found = [digest(), digest()]
    (package / "inner" / "one.py").write_text("LIMIT = 2\n")
    found.append(digest())
    (package / "inner" / "two.py").write_text("")
    found.append(digest())
    (package / "inner" / "two.py").rename(package / "two.py")
    found.append(digest())
    (package / "notes.txt").write_text("nothing that runs")
    found.append(digest())
    assert found[0] == found[1] and found[4] == found[5] and len(set(found)) == 4


def test_the_code_digest_knows_the_compiled_loops(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loops that are compiled anew make another digest, as changed Python does."""
    package = tmp_path / "measured_loops"
    package.mkdir()
    (package / "__init__.py").write_text("")
    modules = (find_spec(name) for name in journal.HASHED_PACKAGES)
    natives = [each.name for each in modules if each and (each.origin or "").endswith(EXTENSION_SUFFIXES[0])]
    assert len(natives) == 2  # of both packages
    digest = journal.code_digest.__wrapped__
    monkeypatch.syspath_prepend(str(tmp_path))
    found = []
    for native in natives:
        own = native.rpartition(".")[2]
        module = package / f"{own}{EXTENSION_SUFFIXES[0]}"
        names = [f"measured_loops.{own}" if name == native else name for name in journal.HASHED_PACKAGES]
        monkeypatch.setattr(journal, "HASHED_PACKAGES", tuple(names))
        for loops in (b"one", b"other"):
            module.write_bytes(loops)
            found.append(digest())
        monkeypatch.undo()
        monkeypatch.syspath_prepend(str(tmp_path))
    assert len(set(found)) == 4


def test_two_runs_in_one_folder_do_not_meet(tmp_path: Path) -> None:
    with Journal(tmp_path, CONDITIONS) as first:
        with pytest.raises(CmpDesignError, match="in use by another run"):
            Journal(tmp_path, CONDITIONS)
        first.add("draw-0", {"value": 1.0})
    with Journal(tmp_path, CONDITIONS) as second:
        assert second.results == {"draw-0": {"value": 1.0}}


def test_a_journal_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        Journal(tmp_path / "file", CONDITIONS)


def test_more_trials_reuse_those_done(tmp_path: Path) -> None:
    first = all_of(tmp_path, trials=TRIALS[:2])
    assert all_of(tmp_path)[:2] == first
    documents = [json.loads(line) for line in (tmp_path / JOURNAL_NAME).read_text().splitlines()]
    assert [document.get("trial") for document in documents[1:]] == [trial.key for trial in TRIALS]


def test_bad_options_name_the_value() -> None:
    with pytest.raises(CmpDesignError, match="workers is 0"):
        RunOptions(1, workers=0)
    with pytest.raises(CmpDesignError, match="trials is 0"):
        RunOptions(0)
    with pytest.raises(CmpDesignError, match="seed is -1"):
        RunOptions(1, -1)


def test_two_trials_of_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CmpDesignError, match="same name"):
        all_of(tmp_path, trials=[TRIALS[0], TRIALS[0]])


def test_the_fingerprint_knows_every_condition() -> None:
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1}) != fingerprint({"a": 1, "b": 3})
