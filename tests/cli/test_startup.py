"""The first run: what is compiled, what is said of it, and `terrapath warmup`."""

import json
import logging
import subprocess
import sys
from pathlib import Path

import pytest
from numba import config

from kernel_copies import copy_machinery
from processes import in_another_process
from terrapath._kernels import cache, compiler, second_core
from terrapath._support.extras import EXTRA_OF
from terrapath.cli import console
from terrapath.cli.main import run
from terrapath.errors import InputError
from terrapath.planners import warmup
from terrapath.surface import Surface

# What is said


class Terminal:
    """Standard error with somebody watching."""

    def __init__(self, watched=True):
        self.text, self.watched = "", watched

    def isatty(self):
        return self.watched

    def write(self, text):
        self.text += text

    def flush(self):
        pass


def compile_two():
    for name in ("grow", "march"):
        logging.getLogger(console.LOGGER).info("compiling %s", name)


@pytest.mark.parametrize(
    ("quiet", "watched", "work", "lines"),
    [
        (False, True, compile_two, 1),
        (True, True, compile_two, 0),
        (False, False, compile_two, 0),
        (False, True, lambda: None, 0),
    ],
)
def test_compiling_is_told_once_where_it_happens_and_somebody_watches(
    quiet, watched, work, lines, monkeypatch
):
    terminal = Terminal(watched)
    monkeypatch.setattr(sys, "stderr", terminal)
    with console.compiling_announced(quiet):
        work()
    compile_two()  # which is nobody's business any more
    assert terminal.text.count("compiling kernels, once") == lines
    assert len(terminal.text.splitlines()) == lines
    assert not logging.getLogger(console.LOGGER).handlers


CALLEE = "@kernel\ndef callee(x, n):\n    return x * (n + 1)\n"
CALLER = (
    "import numpy as np\nfrom copied._kernels.callee import callee\n\n"
    "@kernel\ndef caller(x, n):\n    return callee(x, 2) + callee(x, n) + callee(x, np.int32(n))\n"
)
CALL = (
    "import json, logging, sys; sys.path.insert(0, {!r})\n"
    "told = []\n"
    "class Listener(logging.Handler):\n"
    "    def emit(self, record): told.append(record.getMessage())\n"
    "logger = logging.getLogger({!r}); logger.setLevel('INFO'); logger.addHandler(Listener())\n"
    "from copied._kernels.caller import caller; from copied._kernels.callee import callee\n"
    "from copied._kernels import cache\n"
    "first = caller(1.0, 3); told_first = list(told); second = callee(1.0, 3)\n"
    "parts = len(callee.part.overloads)\n"
    "print(json.dumps([first, second, told_first, told, parts, len(cache.kept_files())]))"
)


@pytest.fixture
def call(tmp_path):
    """A package of two kernels, one of which calls the other, in processes that share a cache."""
    copy_machinery(tmp_path, callee=CALLEE, caller=CALLER)
    code = CALL.format(str(tmp_path), console.LOGGER)
    return lambda: in_another_process(code, NUMBA_CACHE_DIR=str(tmp_path / "cache"))


def test_a_kernel_that_kernels_call_is_compiled_by_itself_only_for_python(call):
    first, second, told_first, told, parts, files = call()
    assert (first, second) == (11.0, 4.0)
    assert told_first == ["compiling caller"]
    assert told == ["compiling caller", "compiling callee"]
    assert parts == 1  # one for integers of all widths
    assert files == 2  # one of each
    first, second, told_first, told, parts, files = call()
    assert (first, second, told, parts, files) == (11.0, 4.0, [], 0, 2)


ALLOCATING = """
import numpy as np

@allocating_kernel
def summed(n):
    return np.ones(n).sum()

@kernel
def doubled(n):
    return 2.0 * summed(n)
"""


def test_a_kernel_is_loaded_without_what_compiles_it(tmp_path):
    copy_machinery(tmp_path, allocating=ALLOCATING)
    code = (
        f"import json, sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from copied._kernels.allocating import cache_statistics, doubled\n"
        "print(json.dumps([doubled(3), cache_statistics(), sorted(sys.modules)]))"
    )
    found = [in_another_process(code, NUMBA_CACHE_DIR=str(tmp_path / "cache")) for _ in range(2)]
    values, statistics, modules = zip(*found, strict=True)
    assert values == (6.0, 6.0)
    assert [done["loaded"] for done in statistics] == [0, 1]
    compiling = {"numba.np.arraymath", "numba.np.linalg", "scipy.linalg"}
    assert compiling <= set(modules[0])
    assert not compiling & set(modules[1])


# terrapath warmup


@pytest.fixture
def kitchen(tmp_path, monkeypatch):
    """Two rehearsals that write a file each; returns what was rehearsed."""
    rehearsed = []

    def rehearse(name):
        rehearsed.append(name)
        end = cache._short(cache.environment())
        cache._write(tmp_path / f"{name}.{end}.key.nbc", bytes(1_000_000))

    work = [warmup.Rehearsal(name, lambda name=name: rehearse(name)) for name in ("one", "two")]
    monkeypatch.setattr(warmup, "rehearsals", lambda: work)
    monkeypatch.setattr(cache, "directory", lambda: tmp_path)
    monkeypatch.setattr(second_core, "cores", lambda: 1)
    return rehearsed


def test_warming_up_compiles_once_and_then_says_that_all_are_there(kitchen, tmp_path, capsys):
    assert run(["warmup"]) == 0
    assert kitchen == ["one", "two"]
    said = capsys.readouterr()
    assert "compiled 2 kernels" in said.out
    assert f"2.0 MB in {tmp_path}" in said.out
    assert said.err == ""
    assert run(["warmup"]) == 0
    assert kitchen == ["one", "two"]
    assert "all kernels are compiled already: 2.0 MB" in capsys.readouterr().out
    assert run(["warmup", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_what_is_done_is_told(kitchen):
    seen = []
    warmup.warm_up(lambda *told: seen.append(told))
    assert seen == [("one", 0, 2), ("two", 1, 2), ("compiled", 2, 2)]


def spoil_list(folder):
    (folder / warmup.LIST_FILE).write_text('{"key": 1')


def spoil_content(folder):
    (folder / warmup.LIST_FILE).write_text("[]")


def lose_a_kernel(folder):
    next(folder.glob("one.*.nbc")).unlink()


def damage_a_kernel(folder):
    kernel = next(folder.glob("one.*.nbc"))
    content = bytearray(kernel.read_bytes())
    content[500] ^= 1
    kernel.write_bytes(content)


@pytest.mark.parametrize(
    ("spoil", "compiled"),
    [(spoil_list, 0), (spoil_content, 0), (lose_a_kernel, 1), (damage_a_kernel, 1)],
)
def test_a_cache_that_lacks_something_is_warmed_again(spoil, compiled, kitchen, tmp_path):
    warmup.warm_up()
    spoil(tmp_path)
    assert warmup.warm_up().compiled == compiled
    assert kitchen == ["one", "two"] * 2
    assert warmup.warm_up().compiled == 0


def test_other_kernels_or_another_compiler_are_warmed_anew(kitchen, monkeypatch):
    warmup.warm_up()
    assert cache.STAMP in cache.environment()
    monkeypatch.setattr(cache, "environment", lambda: "another")
    warmup.warm_up()
    assert kitchen == ["one", "two"] * 2


def test_kernels_that_cannot_be_kept_are_one_clear_line(kitchen, monkeypatch, capsys):
    monkeypatch.setattr(cache, "unkept", lambda: "no room; set NUMBA_CACHE_DIR")
    assert run(["warmup"]) == 2
    assert capsys.readouterr().err == "terrapath: no room; set NUMBA_CACHE_DIR\n"


def test_an_interrupt_leaves_no_list(kitchen, tmp_path, monkeypatch):
    def interrupt():
        raise KeyboardInterrupt

    monkeypatch.setattr(warmup, "rehearsals", lambda: [warmup.Rehearsal("stop", interrupt)])
    assert run(["warmup"]) == 130
    assert not (tmp_path / warmup.LIST_FILE).exists()


def test_without_a_compiler_there_is_nothing_to_warm(monkeypatch, capsys):
    monkeypatch.setattr(config, "DISABLE_JIT", 1)
    assert compiler.cache_directory() is None
    with pytest.raises(InputError, match="NUMBA_DISABLE_JIT is set"):
        warmup.warm_up()
    assert run(["warmup"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_both_classes_of_surface_are_rehearsed_by_every_kind_of_work():
    classes = {type(make().data) for make in warmup.SURFACES.values()}
    assert {kind.__name__ for kind in classes} == {"Peaks", "Spline"}
    assert all(isinstance(make(), Surface) for make in warmup.SURFACES.values())
    assert warmup.SURFACES["spline"]().least_cost != 1.0  # with costs
    assert {kind.__name__.lower() for kind in classes} == set(warmup.SURFACES)
    assert len(warmup.rehearsals()) == len(warmup.KINDS) * len(warmup.SURFACES)


# What is imported


def modules_of(*arguments):
    """What a run of the command has imported: packages, and the parts of SciPy."""
    code = (
        f"import sys; from terrapath.cli.main import run; run({list(arguments)})\n"
        "import json; sys.stdout.write('\\n'); print(json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path.cwd()
    )
    modules = json.loads(done.stdout.splitlines()[-1])
    parts = {".".join(name.split(".")[:2]) for name in modules if name.startswith("scipy.")}
    return {name.split(".")[0] for name in modules} | parts


FOR_SOME = {
    "geopandas", "gpxpy", "matplotlib", "pandas", "plotly", "pyogrio", "pyproj", "rasterio",
    "rich", "sympy", "xarray",
}  # fmt: skip


def test_help_imports_nothing_heavy():
    modules = modules_of("--help")
    assert not modules & (FOR_SOME | {"numpy", "numba", "scipy", "shapely", "pydantic"})


def test_a_route_and_its_picture_take_no_extra_and_little_of_scipy(tmp_path):
    outputs = ("--output", str(tmp_path / "route.geojson"), "--plot", str(tmp_path / "route.png"))
    modules = modules_of("plan", "jacksboro", "--samples", "500", "--no-bound", *outputs)
    assert {"matplotlib", "pyproj", "rasterio"} <= modules
    assert not modules & (EXTRA_OF.keys() | {f"scipy.{part}" for part in ("optimize", "stats")})


def test_a_plan_on_a_scene_imports_what_it_needs():
    wanted = ("plan", "six-peaks", "--json", "--samples", "500")
    modules_of(*wanted)  # compiles, which takes more
    modules = modules_of(*wanted)
    assert "numba" in modules
    scipy = {"fft", "integrate", "interpolate", "linalg", "ndimage", "optimize", "sparse"}
    assert not modules & (FOR_SOME | {f"scipy.{part}" for part in scipy})
