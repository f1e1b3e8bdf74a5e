"""The walls of the house: which package may import which, and that every equation stands where .readme/method.md says."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FLOORS = {  # of pipe_fmu, from the ground up: a module imports from lower floors, and from its own package
    "arrays": 0, "compiled": 0, "checks": 0, "tables": 0, "rules": 0,
    "simd": 1, "environment": 1, "notes": 1, "section": 1,
    "maths": 2,
    "element": 3,
    "loads": 4,
    "line": 5, "parameters": 5,
    "step": 6, "statics": 6, "results": 6, "values": 6,
    "mesh": 7, "validity": 7,
    "vectors": 8,
    "constants": 9, "follow": 9,
    "model": 10,
    "pipe": 11, "substeps": 11,
    "native": 12,
    "slave": 13,
}  # fmt: skip
WITH_UNITS = {  # where master imports the two units; no process that runs FMUs imports these
    "master.with_units", "master.studies", "master.scene.sections", "master.scene.keys",
}  # fmt: skip


def imports(path):
    """Absolute names of the modules of this project that a file imports, at any depth of its text."""
    module = [*path.relative_to(ROOT).with_suffix("").parts]
    package = module[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            name = ".".join([*base, *(node.module or "").split(".")]).rstrip(".")
            yield name
            yield from (f"{name}.{alias.name}" for alias in node.names if (ROOT / name.replace(".", "/") / f"{alias.name}.py").exists())


def sources(package):
    return sorted((ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("path", sources("pipe_fmu"), ids=lambda path: str(path.relative_to(ROOT)))
def test_pipe_fmu_imports_downwards_only_and_nothing_of_the_others(path):
    own = path.relative_to(ROOT / "pipe_fmu").parts[0].removesuffix(".py")
    for name in imports(path):
        top, _, rest = name.partition(".")
        assert top not in ("vessel_fmu", "master")
        if top != "pipe_fmu" or own == "__init__":
            continue
        room = rest.split(".")[0]
        if room and room != own:
            assert FLOORS[room] < FLOORS[own] or {room, own} <= {"step", "statics", "results"}, f"{path} imports {name}"


@pytest.mark.parametrize("path", sources("vessel_fmu"), ids=lambda path: str(path.relative_to(ROOT)))
def test_vessel_fmu_imports_neither_the_pipe_nor_the_master(path):
    assert not {name.partition(".")[0] for name in imports(path)} & {"pipe_fmu", "master"}


@pytest.mark.parametrize("path", sources("master"), ids=lambda path: str(path.relative_to(ROOT)))
def test_only_named_modules_of_the_master_import_the_units(path):
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    if {name.partition(".")[0] for name in imports(path)} & {"pipe_fmu", "vessel_fmu"}:
        assert any(module == name or module.startswith(f"{name}.") for name in WITH_UNITS)


def named():
    """(equations, file, function) of every place that the concordance names."""
    for line in (ROOT / ".readme" / "method.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) == 6 and re.match(r"\(\d", cells[1]):
            numbers = [int(n) for n in re.findall(r"\((\d+)\)", cells[1])]
            yield from ((numbers, *place) for place in re.findall(r"`([\w/]+\.py):(\w+)`", cells[3]))


@pytest.mark.parametrize(("numbers", "file", "function"), list(named()))
def test_every_equation_stands_where_the_concordance_says(numbers, file, function):
    text = (ROOT / file).read_text(encoding="utf-8")
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == function]
    assert nodes, f"{file} has no {function}"
    body = "\n".join(ast.get_source_segment(text, node) for node in nodes)
    missing = [n for n in numbers if f"({n})" not in body]
    assert not missing, f"{file}:{function} does not name eqs. {missing}"
