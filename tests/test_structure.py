"""The package keeps the shape that makes it easy to read: counted from its source."""

import ast
import inspect
import statistics
import tomllib
from importlib.metadata import files
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import terrapath as tp
from common import ROOT
from processes import in_another_process
from rasters import write

PACKAGE = ROOT / "src" / "terrapath"
SOURCES = sorted(PACKAGE.rglob("*.py"))
KERNELS = sorted((PACKAGE / "_kernels").rglob("*.py"))

Function = ast.FunctionDef | ast.AsyncFunctionDef


def source_of(path):
    return path.read_text(encoding="utf-8")


def lines_of(function):
    """Of its body, without the docstring."""
    body = function.body[ast.get_docstring(function) is not None :]
    return body[-1].end_lineno - body[0].lineno + 1 if body else 0


def lengths_of(paths):
    trees = [ast.parse(source_of(path)) for path in paths]
    return [
        lines_of(node) for tree in trees for node in ast.walk(tree) if isinstance(node, Function)
    ]


DESCRIBED = '''
def f(
    x,
):
    """What it does.

    And more.
    """
    y = x
    return (
        y
    )
'''


def test_a_body_is_counted_without_its_docstring():
    assert lines_of(ast.parse(DESCRIBED).body[0]) == 4
    assert lines_of(ast.parse('def f():\n    """Doc."""').body[0]) == 0


def test_the_package_is_a_few_folders_and_fewer_files():
    folders = [p for p in PACKAGE.iterdir() if p.is_dir() and p.name != "__pycache__"]
    assert len(folders) <= 16
    assert len([p for p in PACKAGE.iterdir() if p.is_file()]) <= 8


def test_functions_are_short():
    lengths = lengths_of(SOURCES)
    assert len(lengths) > 1000
    assert statistics.median(lengths) <= 8
    assert statistics.quantiles(lengths, n=10)[-1] <= 20
    assert max(lengths_of(KERNELS)) <= 40


def test_a_module_holds_one_idea():
    long = {str(p): n for p in SOURCES if (n := len(source_of(p).splitlines())) > 400}
    assert not long


# What is public is described


def is_public(node):
    return isinstance(node, Function | ast.ClassDef) and not node.name.startswith("_")


def public_definitions(path):
    """Functions, classes and their methods, each with its name in the file."""
    for node in filter(is_public, ast.parse(source_of(path)).body):
        yield node.name, node
        if isinstance(node, ast.ClassDef):
            yield from ((f"{node.name}.{m.name}", m) for m in filter(is_public, node.body))


def is_annotated(node):
    if isinstance(node, ast.ClassDef):
        return True
    given = node.args
    named = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
    typed = all(a.annotation for a in named if a and a.arg not in {"self", "cls"})
    return typed and node.returns is not None


def test_every_public_definition_is_described_and_typed():
    found = [
        (f"{path.relative_to(PACKAGE)}: {name}", node)
        for path in SOURCES
        if path not in KERNELS
        for name, node in public_definitions(path)
    ]
    assert len(found) > 300
    assert not [place for place, node in found if not ast.get_docstring(node)]
    assert not [place for place, node in found if not is_annotated(node)]


def test_every_name_of_the_package_is_there_and_described():
    stub = ast.parse(source_of(PACKAGE / "__init__.pyi"))
    names = {a.asname for node in stub.body for a in getattr(node, "names", [])} - {"__version__"}
    assert names >= {"Problem", "Surface", "plan", "refine", "scenes"}
    for name in names:
        thing = getattr(tp, name)
        assert inspect.isclass(thing) or inspect.isroutine(thing) or isinstance(thing, ModuleType)
        # A class without a docstring would show its base's.
        assert vars(thing).get("__doc__") if inspect.isclass(thing) else thing.__doc__, name


# What is needed


def test_few_packages_are_required():
    project = tomllib.loads(source_of(ROOT / "pyproject.toml"))["project"]
    assert len(project["dependencies"]) <= 11


def test_the_wheel_holds_the_package_alone():
    installed = [Path(str(file)) for file in files("terrapath")]
    if Path("terrapath/__init__.py") not in installed:
        pytest.skip("installed in place, not from a wheel")
    beside = {p.parts[0] for p in installed if not p.parts[0].startswith("terrapath")}
    assert beside <= {".."}  # the command, in the folder of commands
    assert not [p for p in installed if "benchmarks" in p.parts or "tests" in p.parts]


# Modules of the package, without kernels, of which more than the top level runs, functions and
# bodies of classes alike: so many somebody has to look into who follows a plan.
FOLLOWED = """
import json, sys
from pathlib import Path
entered = set()
def note(frame, event, _):
    if event == "call" and frame.f_code.co_name != "<module>":
        entered.add(frame.f_code.co_filename)
sys.setprofile(note)
from terrapath.cli.main import run
code = run({arguments})
sys.setprofile(None)
import terrapath
package = Path(terrapath.__file__).parent
modules = [Path(p).relative_to(package) for p in entered if Path(p).is_relative_to(package)]
print(json.dumps([code, sorted(str(m) for m in modules if m.parts[0] != "_kernels")]))
"""


@pytest.fixture
def hill(tmp_path):
    y, x = np.mgrid[0:30, 0:30]
    return write(tmp_path / "map.tif", 20.0 * np.exp(-((x - 15) ** 2 + (y - 12) ** 2) / 60.0))


def test_a_plan_on_a_map_goes_through_few_modules(hill):
    ends = ["--start", "500050,3999900", "--goal", "500250,4000050"]
    code = FOLLOWED.format(arguments=["plan", str(hill), *ends])
    status, modules = in_another_process(code)
    assert status == 0
    assert {"cli/plan.py", "planners/rrt_star.py", "io/rasters.py"} <= set(modules)
    assert len(modules) <= 40, f"{len(modules)} modules: {' '.join(modules)}"
