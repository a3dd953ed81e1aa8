"""Libraries of extras: imported where they are used, within ``with extra(...)`` of an extra that brings them."""

from __future__ import annotations

import ast
import importlib.metadata
import importlib.util
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from cmpdesign.errors import CmpDesignError
from cmpdesign.libraries import (
    OPENCV_DISTRIBUTIONS,
    extra,
    install_command,
    opencv_version,
    require_libraries,
)
from tests.house.source_trees import parsed, python_files

ROOT = Path(__file__).parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "optional-dependencies"
]
NOT_OF_USERS = ("all", "bench", "dev")
# Modules of another name than their distribution.
MODULES = {"cadquery-ocp-novtk": "OCP", "foxglove-sdk": "foxglove", "rerun-sdk": "rerun"}


def brought_modules(name: str) -> frozenset[str]:
    """The modules that an extra brings, with those of the extras that it names."""
    found: set[str] = set()
    for line in EXTRAS[name]:
        if own := re.fullmatch(r"cmpdesign\[(.*)\]", line):
            found |= frozenset().union(*map(brought_modules, own[1].split(",")))
        else:
            found |= {MODULES.get(wanted, wanted) for wanted in re.findall(r"^[A-Za-z0-9._-]+", line)}
    return frozenset(found)


BROUGHT = {name: brought_modules(name) for name in EXTRAS if name not in NOT_OF_USERS}
LIBRARIES = frozenset().union(*BROUGHT.values())


def bare_imports(node: ast.AST, brought: frozenset[str] = frozenset()) -> Iterator[str]:
    """Imports of libraries of extras that no extra of a surrounding ``with`` brings, as "line: module"."""
    if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
        return
    if isinstance(node, ast.With):
        for item in node.items:
            call = item.context_expr
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "extra":
                brought |= BROUGHT.get(getattr(call.args[0], "value", ""), frozenset())
    modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
    modules += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
    for top in (module.partition(".")[0] for module in modules):
        if top in LIBRARIES - brought:
            yield f"{node.lineno}: {top}"  # type: ignore[attr-defined]
    for child in ast.iter_child_nodes(node):
        yield from bare_imports(child, brought)


def test_libraries_of_extras_are_imported_with_their_extra() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{each}"
        for package in ("cmpdesign", "extractor")
        for path in python_files(ROOT / package)
        for each in bare_imports(parsed(path))
    ]
    assert found == []


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("import scipy.spatial", ["1: scipy"]),
        ("def f():\n    from OCP.gp import gp_Pnt", ["2: OCP"]),
        ("with extra('cad'):\n    import scipy, OCP", []),
        ("with extra('laser'):\n    import OCP", ["2: OCP"]),
        ("if TYPE_CHECKING:\n    import zarr", []),
        ("import shapely", []),
    ],
)
def test_the_rule_finds_what_breaks_it(code: str, found: list[str]) -> None:
    assert list(bare_imports(ast.parse(code))) == found


def test_a_missing_library_names_the_extra_and_the_command() -> None:
    with (
        pytest.raises(
            CmpDesignError, match=r"needs none_such of the extra \[laser\] .*pip install "
        ) as error,
        extra("laser", "write .csv"),
    ):
        import none_such.inner  # noqa: F401
    assert install_command("laser") in str(error.value) and str(error.value).endswith("or write .csv")
    assert isinstance(error.value, ImportError) and error.value.name == "none_such"
    with pytest.raises(CmpDesignError, match=r"needs none_such of the extra \[cad\]"):
        require_libraries("cad", "numpy", "none_such")
    with pytest.raises(ImportError, match="no_name"), extra("laser"):  # not a missing library
        from numpy import no_name  # noqa: F401


def test_every_module_of_an_extra_has_its_name_here() -> None:
    assert [name for name in sorted(LIBRARIES - {"rerun"}) if importlib.util.find_spec(name) is None] == []


def test_one_distribution_of_opencv_is_required_and_installed() -> None:
    """Two would overwrite each other. The version is found for every distribution of OpenCV."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = [*project["dependencies"], *(line for lines in EXTRAS.values() for line in lines)]
    assert {re.split("[<>=]", line)[0] for line in lines if "opencv" in line} == {OPENCV_DISTRIBUTIONS[0]}
    installed = {
        name
        for one in importlib.metadata.distributions()
        if (name := one.metadata["Name"]).startswith("opencv")
    }
    assert len(installed) == 1 and installed < set(OPENCV_DISTRIBUTIONS)
    assert opencv_version() == importlib.metadata.version(installed.pop())
