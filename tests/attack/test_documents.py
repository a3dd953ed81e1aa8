"""Documents that the program wrote and reads back, edited: journals of runs, lists of files; and summaries by schema.

Those of data sets and of reports are in the files beside this one.
"""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest

from cmpdesign.documents.registry import document_schema
from cmpdesign.errors import CmpDesignError
from cmpdesign.evaluation.journal import Journal
from cmpdesign.files.earlier_files import LIST_NAME, files_with_lists, find_stale_files
from tests.attack.documents import wrong_documents
from tests.support.command import run
from tests.support.tracking.files import write_moving_pattern

RESULTS = {"a/1": {"rms_px": 0.01, "lost": [1, 2]}, "a/2": None}


def test_an_edited_journal_gives_its_own_results_or_one_line(tmp_path: Path) -> None:
    with Journal(tmp_path, {"seed": 1}) as journal:
        for key, result in RESULTS.items():
            journal.add(key, result)
    path = tmp_path / "journal.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines()
    refused = 0
    for number, line in enumerate(lines):
        for text in wrong_documents(json.loads(line)):
            changed = [*lines[:number], text, *lines[number + 1 :], ""]
            path.write_text("\n".join(changed), encoding="utf-8", errors="surrogatepass")
            try:
                with Journal(tmp_path, {"seed": 1}) as journal:
                    assert journal.results == RESULTS
            except CmpDesignError as error:
                refused += 1
                assert "\n" not in str(error)
    assert refused > 100


def test_an_edited_list_of_files_removes_nothing_else(tmp_path: Path) -> None:
    """What is no list removes no file; a list of other names or digests removes only what is unchanged and below."""
    (tmp_path / "mold").mkdir()
    files: dict[str, str | bytes] = {"mold/a.stl": b"a", "mold/b.stl": b"b"}
    listed = files_with_lists(files, ["mold/"], tmp_path, "0" * 64)
    for name, data in listed.items():
        (tmp_path / name).write_bytes(data if isinstance(data, bytes) else data.encode())
    (tmp_path / "mold" / "own.txt").write_text("mine")
    now = files_with_lists({"mold/a.stl": b"a"}, ["mold/"], tmp_path, "0" * 64)
    stale = [tmp_path / "mold" / "b.stl"]
    assert find_stale_files(tmp_path, now, ["mold/"], "0" * 64) == stale
    path = tmp_path / "mold" / LIST_NAME
    for text in wrong_documents(json.loads(path.read_text(encoding="utf-8"))):
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        assert find_stale_files(tmp_path, now, ["mold/"], "0" * 64) in ([], stale)


def test_the_file_of_a_summary_has_the_schema_that_is_published(tmp_path: Path) -> None:
    made = write_moving_pattern(tmp_path)
    result = run("track", made / "layout.json", made / "frames", "-o", tmp_path / "a.npz", "--frames", 2)
    assert result.exit_code == 0, result.output
    summary = json.loads((tmp_path / "a.npz.summary.json").read_text(encoding="utf-8"))
    validator = jsonschema.Draft202012Validator(document_schema("track"))
    validator.validate(summary)
    refused = 0
    for name in summary:
        broken = {key: value for key, value in summary.items() if key != name}
        refused += not validator.is_valid(broken)
    assert refused >= len(summary) - 5 and not validator.is_valid(summary | {"more": 1})
    with pytest.raises(jsonschema.ValidationError):
        validator.validate(summary | {"frames": -1})
