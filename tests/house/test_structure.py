"""The structure of the code: folders in an order, small folders, docstrings of packages, short functions.

Every rule is a function of a folder, which lists the violations, and is also tested on a small bad tree.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Iterable
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.house.source_trees import (
    Function,
    Import,
    Tree,
    defined_in,
    functions_of,
    imports_of,
    parsed,
    python_files,
    tree_of,
)

ROOT = Path(__file__).parents[2]
CODE = ("extractor", "cmpdesign", "benchmarks", "tests")
PACKAGES = ("extractor", "cmpdesign")
# A room imports only those that stand before it.
ROOMS = {
    "cmpdesign": (
        "errors libraries units workers watch inputs documents patterns design layout files sensor reading calibration"
        " contact scene products tracking runtime evaluate data api proposal studio cli demo __main__"
    ),
    "extractor": (
        "errors frozen_record quality result presets numeric layout image cells localmap numbering refine complete"
        " pipeline made contact track space draw"
    ),
}
NOT_DESCRIBED = {"extractor", "cmpdesign"}
EXTRACTOR_NEEDS = {"numpy", "cv2"}
MAX_FILES, MAX_LINES, MAX_FUNCTION_LINES, MAX_PARAMETERS = 12, 500, 80, 8
Rule = Callable[[Path], list[str]]


def every_function(root: Path, packages: Iterable[str]) -> Iterable[tuple[Path, Function]]:
    return (
        (path, each) for name in packages for path in python_files(root / name) for each in functions_of(path)
    )


# -- files and folders


def crowded_folders(root: Path) -> list[str]:
    folders = {path.parent for name in CODE for path in python_files(root / name)}
    counts = {folder: len(list(folder.glob("*.py"))) for folder in sorted(folders)}
    return [f"{folder}: {count} files" for folder, count in counts.items() if count > MAX_FILES]


def undescribed_packages(root: Path) -> list[str]:
    trees = [tree_of(root, package) for package in PACKAGES]
    packages = {
        name: path for tree in trees for name, path in tree.files.items() if path.name == "__init__.py"
    }
    missing = [
        path.parent
        for tree in trees
        for path in tree.files.values()
        if not (path.parent / "__init__.py").exists()
    ]
    found = [f"{folder}: no __init__.py" for folder in sorted(set(missing))]
    for name, path in packages.items():
        text = ast.get_docstring(parsed(path)) or ""
        if name not in NOT_DESCRIBED and not ("In:" in text and "Out:" in text):
            found.append(f"{name}: its docstring does not say what goes in and what comes out")
    return found


def long_files_and_functions(root: Path) -> list[str]:
    found = []
    for path in (path for package in PACKAGES for path in python_files(root / package)):
        count = len(path.read_text(encoding="utf-8").splitlines())
        found += [f"{path}: {count} lines"] if count >= MAX_LINES else []
    for path, function in every_function(root, PACKAGES):
        start = function.body[0].lineno if is_command(function) else function.lineno
        count = (function.end_lineno or 0) - start + 1
        found += [f"{path}: {function.name} has {count} lines"] if count >= MAX_FUNCTION_LINES else []
    return found


# -- imports


def only_hands_on(path: Path) -> bool:
    """An ``__init__.py`` that defines nothing but how its names are looked up."""
    own = {node.name for node in parsed(path).body if isinstance(node, Function | ast.ClassDef)}
    return path.name == "__init__.py" and own <= {"__getattr__", "__dir__"}


def inner_imports(tree: Tree) -> Iterable[tuple[str, str, Import]]:
    """(importing module, imported module, import) within a package, but for files that only hand names on."""
    for module, path in tree.files.items():
        for each in () if only_hands_on(path) else imports_of(path, module):
            target = tree.module_of(each)
            if target and target != module:
                yield module, target, each


def contracted(tree: Tree, module: str, target: str) -> tuple[str, str, str]:
    """The folder that contains both, and the two files or subfolders in which the two lie."""
    one, other = (
        [*name.split("."), *(["__init__"] if is_package(tree, name) else [])] for name in (module, target)
    )
    depth = next(k for k, (a, b) in enumerate(zip(one, other, strict=False)) if a != b)
    return ".".join(one[:depth]), one[depth], other[depth]


def is_package(tree: Tree, name: str) -> bool:
    return tree.files[name].name == "__init__.py"


def circles(root: Path) -> list[str]:
    found = []
    for tree in (tree_of(root, package) for package in PACKAGES):
        graphs: dict[str, dict[str, set[str]]] = {}
        for module, target, _ in inner_imports(tree):
            if not only_hands_on(tree.files[target]) or not module.startswith(f"{target}."):
                folder, one, other = contracted(tree, module, target)
                graphs.setdefault(folder, {}).setdefault(one, set()).add(other)
        for folder, graph in graphs.items():
            try:
                TopologicalSorter(graph).prepare()
            except CycleError as error:
                found.append(f"{folder}: {' <- '.join(error.args[1])}")
    return found


def upward_imports(root: Path) -> list[str]:
    """Imports of a later folder, or of names that a package above imports from elsewhere."""
    found = []
    for tree in (tree_of(root, package) for package in PACKAGES):
        order = ROOMS[tree.package].split()
        strange = sorted({name.split(".")[1] for name in tree.files if "." in name} - set(order))
        found += [f"{tree.package}.{room}: has no place in the order" for room in strange]
        for module, target, each in inner_imports(tree):
            if module.startswith(f"{target}.") or target == tree.package:
                if each.name not in defined_in(tree.files[target]):
                    found.append(f"{module}:{each.line}: {each.name} from {target}, above it")
                continue
            one, other = module.split(".")[1], target.split(".")[1]
            if not strange and order.index(other) > order.index(one):
                found.append(f"{module}:{each.line}: {target}, which stands later")
    return found


def strangers_in_the_extractor(root: Path) -> list[str]:
    """All that it imports is the standard library's and a few packages', and nothing is cmpdesign's."""
    allowed = EXTRACTOR_NEEDS | {"extractor"} | set(sys.stdlib_module_names)
    return [
        f"{module}:{each.line}: {each.module}"
        for module, path in tree_of(root, "extractor").files.items()
        for each in imports_of(path, module)
        if each.module.partition(".")[0] not in allowed
    ]


def products_that_know_patterns(root: Path) -> list[str]:
    """A pattern's functions are used where layouts are built; products see layouts, and only the colors' names."""
    return [
        f"{module}:{each.line}"
        for module, path in tree_of(root, "cmpdesign").files.items()
        for each in imports_of(path, module)
        if module.startswith("cmpdesign.products.")
        and each.module == "cmpdesign.patterns"
        and each.name != "colors"
    ]


# -- functions


def parameters(function: Function) -> list[ast.arg]:
    """Without self and cls."""
    every = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    return every[1:] if every and every[0].arg in ("self", "cls") else every


def is_command(function: Function) -> bool:
    """The command line's options are a function's parameters."""
    told = [ast.unparse(each.annotation) for each in parameters(function) if each.annotation]
    return any("typer.Option" in text or "typer.Argument" in text for text in told)


def many_parameters(root: Path) -> list[str]:
    return [
        f"{path}:{function.lineno}: {function.name} has {len(parameters(function))} parameters"
        for path, function in every_function(root, PACKAGES)
        if len(parameters(function)) > MAX_PARAMETERS and not is_command(function)
    ]


def unpacked_parameters(root: Path) -> list[str]:
    """A result of several parts is a record with names."""
    found = []
    for path, function in every_function(root, ["extractor"]):
        names = {each.arg for each in parameters(function)}
        for node in ast.walk(function):
            pairs = []
            if isinstance(node, ast.Assign):
                pairs = [pair for target in node.targets for pair in matched(target, node.value)]
            for target, value in pairs:
                if (
                    isinstance(target, ast.Tuple | ast.List)
                    and isinstance(value, ast.Name)
                    and value.id in names
                ):
                    found.append(f"{path}:{node.lineno}: {function.name} takes {value.id} apart")
    return found


def matched(target: ast.expr, value: ast.expr) -> list[tuple[ast.expr, ast.expr]]:
    """Which value each target of an assignment gets, where both are written out."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        return list(zip(target.elts, value.elts, strict=True))
    return [(target, value)]


RULES: tuple[Rule, ...] = (
    crowded_folders,
    undescribed_packages,
    long_files_and_functions,
    circles,
    upward_imports,
    strangers_in_the_extractor,
    products_that_know_patterns,
    many_parameters,
    unpacked_parameters,
)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_code_keeps_the_rule(rule: Rule) -> None:
    assert rule(ROOT) == []


def test_the_map_of_contributing_is_the_order() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    tables = re.findall(r"each line may import the lines above:\n\n((?:    .+\n)+)", text, re.IGNORECASE)
    lines = [
        line.split("  ", 1)[0] for table in tables for line in re.findall(r"^    (.+)", table, re.MULTILINE)
    ]
    mapped = [name.rstrip("/") for line in lines for name in line.split()]
    assert mapped == [room for rooms in ROOMS.values() for room in [*rooms.split(), "native"]]


# -- the rules can fail

GOOD = {
    "extractor/__init__.py": '"""Top."""\n__version__ = "1"\nif TYPE_CHECKING:\n    from extractor.refine.a import f\n',
    "extractor/errors.py": "class LayoutError(Exception): ...\n",
    "extractor/numeric/__init__.py": '"""Numbers.\n\nIn: some. Out: others."""\n',
    "extractor/numeric/sums.py": "from extractor import __version__\ndef total(a, b): return a + b\n",
    "extractor/refine/__init__.py": '"""Refinement.\n\nIn: some. Out: others."""\n',
    "extractor/refine/a.py": "from extractor.numeric.sums import total\nfrom extractor.refine.solve.b import g\n",
    "extractor/refine/solve/__init__.py": '"""Solving.\n\nIn: some. Out: others."""\n',
    "extractor/refine/solve/b.py": "def g(self, record):\n    one, other = record.parts\n",
    "cmpdesign/__init__.py": '"""Top."""\n',
    "cmpdesign/units.py": "",
    "cmpdesign/cli/__init__.py": '"""Commands.\n\nIn: words. Out: files."""\n',
    "cmpdesign/cli/run.py": "def run(a: Annotated[int, typer.Option()], b, c, d, e, f, g, h, i): ...\n",
}
BAD: tuple[tuple[Rule, dict[str, str], str], ...] = (
    (crowded_folders, {f"tests/unit/test_{k}.py": "" for k in range(13)}, "13 files"),
    (
        undescribed_packages,
        {"extractor/refine/__init__.py": '"""Refinement. In: some."""'},
        "extractor.refine: its",
    ),
    (undescribed_packages, {"extractor/image/input.py": ""}, "no __init__.py"),
    (long_files_and_functions, {"cmpdesign/units.py": "\n" * 500}, "500 lines"),
    (long_files_and_functions, {"cmpdesign/units.py": "def f():\n" + "    1\n" * 79}, "f has 80 lines"),
    (
        circles,
        {"extractor/refine/solve/b.py": "def g():\n    from extractor.refine.a import f\n"},
        "extractor.refine:",
    ),
    (circles, {"extractor/numeric/sums.py": "from ..refine import a\n"}, "extractor: numeric"),
    (circles, {"extractor/numeric/sums.py": "import extractor.refine.a\n"}, "extractor: numeric"),
    (upward_imports, {"extractor/errors.py": "from extractor.numeric.sums import total\n"}, "stands later"),
    (
        upward_imports,
        {"extractor/errors.py": "if TYPE_CHECKING:\n    from extractor import f\n"},
        "f from extractor",
    ),
    (upward_imports, {"extractor/cellar.py": ""}, "extractor.cellar: has no place"),
    (
        strangers_in_the_extractor,
        {"extractor/errors.py": "def f():\n    import cmpdesign.units\n"},
        "errors:2: cmpdesign",
    ),
    (
        products_that_know_patterns,
        {"cmpdesign/products/a.py": "from cmpdesign.patterns import registered_patterns\n"},
        "cmpdesign.products.a:1",
    ),
    (
        many_parameters,
        {"cmpdesign/units.py": "def f(a, b, c, d, *, e, f, g, h, i=1): ...\n"},
        "f has 9 parameters",
    ),
    (
        unpacked_parameters,
        {"extractor/errors.py": "def f(place):\n    x, y = place\n"},
        "f takes place apart",
    ),
    (unpacked_parameters, {"extractor/errors.py": "def f(a, b):\n    (x, y), z = a, b\n"}, "f takes a apart"),
)


def written(root: Path, changes: dict[str, str]) -> Path:
    for name, text in {**GOOD, **changes}.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return root


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_a_good_tree_keeps_every_rule(rule: Rule, tmp_path: Path) -> None:
    assert rule(written(tmp_path, {})) == []


@pytest.mark.parametrize(("rule", "changes", "said"), BAD)
def test_a_bad_tree_breaks_the_rule(rule: Rule, changes: dict[str, str], said: str, tmp_path: Path) -> None:
    found = rule(written(tmp_path, changes))
    assert found and said in found[0], found


def test_every_rule_is_seen_to_fail() -> None:
    assert {rule for rule, _, _ in BAD} == set(RULES)
