"""The layout, held by a test: modules import from above only, third parties have owners."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import eigassign

ROOT = Path(eigassign.__file__).parent
OWNERS = {
    "yaml": {"case"},
    "pydantic": {"case"},
    "pydantic_core": {"case"},
    "osqp": {"assignment"},
    "sklearn": {"chart"},
    "h5py": {"output"},
    "matplotlib": {"output"},
    "markupsafe": {"output"},  # comes with Jinja
    "jinja2": {"output"},
    "platformdirs": {"output"},
    "click": {"cli"},
    "threadpoolctl": {"process"},
}
EVERYWHERE = {"numpy", "scipy"}
LATE = (  # what few cases or options need is imported when they do: a run of two_link has none
    *("mechanism.elements.solid_stress", "mechanism.elements.superelement", "mechanism.imports"),
    *("mechanism.solids", "output.figures", "output.reports.page"),
)
PRINTING = {
    *("cli.arguments", "cli.inspect", "cli.runs"),
    "output.console",
}
MODULES = sorted(ROOT.rglob("*.py"))
PACKAGES = sorted(path.parent for path in ROOT.rglob("__init__.py"))


def name_of(path: Path) -> str:
    """``modal/exact.py`` → ``modal.exact``; of the package itself the empty text."""
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    return name.removesuffix("__init__").removesuffix(".")


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def called(path: Path) -> set[str]:
    """What is called anywhere in a module, as it is written."""
    return {ast.unparse(n.func) for n in ast.walk(parsed(path)) if isinstance(n, ast.Call)}


def imports(tree: ast.AST) -> Iterator[str]:
    """Full names of the modules imported anywhere below ``tree``, except for type checking."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        yield from imports(node)


def reading_order(package: Path) -> list[str]:
    """Names listed in a package's docstring: four spaces, name, two spaces or more, what it is."""
    text = ast.get_docstring(parsed(package / "__init__.py")) or ""
    return re.findall(r"^    (\w+)  +\S", text, re.MULTILINE)


def test_modules_import_only_from_those_above_them_in_the_reading_order() -> None:
    for package in PACKAGES:
        prefix = name_of(package / "__init__.py")
        order = reading_order(package)
        inside = {p.stem for p in package.glob("*.py")} | {
            p.parent.name for p in package.glob("*/*.py")
        }
        assert set(order) == inside - {"__init__"}, prefix
        for k, name in enumerate(order):
            own = package / name if (package / name).is_dir() else package / f"{name}.py"
            for path in sorted(own.rglob("*.py")) if own.is_dir() else [own]:
                for used in imports(parsed(path)):
                    full = f"eigassign.{prefix}." if prefix else "eigassign."
                    part = used.removeprefix(full).split(".")[0] if used.startswith(full) else name
                    assert part not in order[k + 1 :], f"{name_of(path)} imports {used}"


def test_our_own_modules_are_imported_at_the_top() -> None:
    """But for `LATE`, the command line and ``import eigassign``, which load what is used only."""
    for path in MODULES:
        name = name_of(path)
        functions = (n for n in ast.walk(parsed(path)) if isinstance(n, ast.FunctionDef))
        inside = {used for function in functions for used in imports(function)}
        if name and name.split(".")[0] not in ("cli", "__main__"):
            ours = {u.removeprefix("eigassign.") for u in inside if u.startswith("eigassign.")}
            assert not {used for used in ours if not used.startswith(LATE)}, name


def test_third_parties_have_one_owner_each_and_the_case_needs_no_numerical_package() -> None:
    for path in MODULES:
        package = name_of(path).split(".")[0]
        parties = {name.split(".")[0] for name in imports(parsed(path))}
        for party in parties:
            known = party in sys.stdlib_module_names | EVERYWHERE | {"eigassign"}
            assert known or package in OWNERS.get(party, ()), f"{name_of(path)} imports {party}"
        assert package != "case" or not parties & EVERYWHERE, name_of(path)


def test_only_the_command_line_and_the_console_print_and_only_the_former_sets_exit_codes() -> None:
    for path in MODULES:
        name = name_of(path)
        if name not in PRINTING:
            assert not called(path) & {"print", "click.echo", "sys.stdout.write"}, name
        if name not in {"cli", "__main__"}:
            assert not {"sys.exit", "exit", "quit", "os._exit"} & called(path), name


def test_the_command_line_imports_only_click_and_light_modules_at_its_top() -> None:
    light = {"click", "cli", "process", "files", "_version", "errors"}
    for path in sorted((ROOT / "cli").glob("*.py")):
        at_top = {
            name.removeprefix("eigassign.").split(".")[0]
            for node in parsed(path).body
            if isinstance(node, (ast.Import, ast.ImportFrom))
            for name in imports(ast.Module(body=[node], type_ignores=[]))
        }
        assert at_top <= light | sys.stdlib_module_names, path


TESTS = sorted(Path(__file__).parent.rglob("*.py"))
# of named tuples, of os and of notebooks: no secrets
STANDARD = {"_replace", "_asdict", "_fields", "_exit", "_repr_html_", "_repr_png_"}


def private_names(tree: ast.Module) -> Iterator[str]:
    """Names with an underscore that a test imports, reads of another object, or patches."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield from (alias.name for alias in node.names if alias.name.startswith("_"))
        elif isinstance(node, ast.Attribute) and node.attr.startswith("_"):
            if ast.unparse(node.value) not in ("self", "cls"):
                yield node.attr
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("setattr", "patch")):
            texts = (a.value for a in node.args if isinstance(a, ast.Constant))
            yield from (str(text).rpartition(".")[2] for text in texts)


def test_tests_speak_to_faces_and_to_nothing_private() -> None:
    """A module below a package may move, be split or renamed, and no test is touched."""
    modules = {f"eigassign.{name_of(path)}" for path in MODULES}
    names = [path.name for path in TESTS if path.name != "conftest.py"]
    assert sorted(set(names)) == sorted(names)
    for path in TESTS:
        own = {name for name in imports(parsed(path)) if name.split(".")[0] == "eigassign"}
        homes = {name if name in modules else name.rpartition(".")[0] for name in own}
        assert all(home.count(".") <= 1 for home in homes), f"{path} imports from {homes}"
        calls = (n for n in ast.walk(parsed(path)) if isinstance(n, ast.Call))
        patching = ("setattr", "patch", "import_module")
        named = [c.args[0] for c in calls if c.args and ast.unparse(c.func).endswith(patching)]
        inner = [ast.unparse(n) for n in named if re.match("'eigassign[.].*[.]", ast.unparse(n))]
        assert not inner, f"{path} reaches into {inner}"
        used = {n for n in private_names(parsed(path)) if re.match("_[^_]", n)} - STANDARD
        assert not used, path
