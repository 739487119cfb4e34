"""Kernels compile plainly, with the same answers, where Numba's inside is not what it was."""

import json
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from numba import config
from numba.core.errors import TypingError

from commands import FEW_KERNELS
from common import ROOT, mostly_slow
from kernel_copies import copy_machinery
from processes import in_another_process
from terrapath._kernels import fallback
from terrapath._kernels.compiler import inner_kernel, kernel
from terrapath.cli.main import run

PYPROJECT = ROOT / "pyproject.toml"


@pytest.mark.parametrize(
    ("version", "tested"),
    [
        ("0.61.2", False),
        ("0.63.0rc1", True),
        ("0.62.1", False),
        ("0.68.1", True),
        ("0.69.0dev0+12.gabc", False),
        ("0.70", False),
        ("1.65.0", False),
        ("unknown", False),
    ],
)
def test_the_tested_versions_have_two_ends(version, tested):
    assert fallback.is_tested(version) == tested


def test_the_package_declares_the_tested_versions():
    declared = tomllib.loads(PYPROJECT.read_text())["project"]["dependencies"]
    (low, high) = (".".join(map(str, v)) for v in (fallback.TESTED_FROM, fallback.TESTED_BELOW))
    assert f"numba>={low},<{high}" in declared


# A package of its own, so that something may be broken before it is imported

SHAPES = """
import numpy as np
from typing import NamedTuple
from copied._kernels.dispatch import per_class

class Disc(NamedTuple):
    radius: float

class Box(NamedTuple):
    width: float
    height: float

@inner_kernel
def area_of_disc(shape):
    return 3.0 * shape.radius * shape.radius

@kernel
def area_of_box(shape):
    return shape.width * shape.height

@per_class({Disc: area_of_disc, Box: area_of_box})
def area(shape):
    ...

@allocating_kernel
def areas(shape, n):
    return np.ones(n) * area(shape)

@allocating_kernel
def total(shape, n):
    return areas(shape, n).sum()

@kernel
def scaled(shape, factor):
    return factor * area(shape)
"""
USE = """
import json, sys, warnings
sys.path.insert(0, {folder!r})
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter("always")
    {before}
    from copied._kernels import shapes
    from copied._kernels.compiler import cache_statistics, is_plain
    disc, box = shapes.Disc(2.0), shapes.Box(3.0, 5.0)
    found = [shapes.total(disc, 2), shapes.total(box, 2), shapes.area(disc)]
    {between}
    found += [shapes.scaled(disc, 0.5), shapes.scaled(box, 1), shapes.total(box, 2)]
print(json.dumps([found, is_plain(), [str(w.message) for w in told], cache_statistics()]))
"""
EXPECTED = [24.0, 30.0, 12.0, 6.0, 15.0, 30.0]


@pytest.fixture
def use(tmp_path):
    """Answers, whether they were found plainly, what was said, and what was compiled."""
    copy_machinery(tmp_path, shapes=SHAPES)

    def use(before="pass", between="pass"):
        code = USE.format(folder=str(tmp_path), before=before, between=between)
        return in_another_process(code, NUMBA_CACHE_DIR=str(tmp_path / "cache"))

    return use


def test_with_a_tested_version_kernels_are_linked(use):
    found, plain, told, statistics = use()
    assert (found, plain, told) == (EXPECTED, False, [])
    # By what Python called: two types each of `total` and `scaled`, and one implementation.
    assert statistics == {"loaded": 0, "compiled": 5}
    assert use()[3] == {"loaded": 5, "compiled": 0}


BROKEN = {
    "an older version": ("import numba; numba.__version__ = '0.61.2'", "numba 0.61.2 is not"),
    "a newer version": ("import numba; numba.__version__ = '0.99.0'", "numba 0.99.0 is not"),
    "a class that has gone": (
        "import numba.core.codegen as c; del c.JITCodeLibrary",
        "cannot import name 'JITCodeLibrary'",
    ),
    "a module that has gone": (
        "import numba; sys.modules['numba.core.compiler_machinery'] = None",
        "compiler_machinery",
    ),
    "another constructor": (
        "from copied._kernels import linking as l; l.LinkedKernel.__init__ = lambda self: None",
        "TypeError: ",
    ),
    "a method of another shape": (
        "from copied._kernels import linking as l; l._KernelCompiler.compile_extra = lambda _: 0",
        "TypeError: ",
    ),
    "a library that is built in another way": (
        "from copied._kernels import linking as l; l._KernelLibrary._optimize_final_module = 3",
        "not callable",
    ),
    "parts that fail": (
        "from copied._kernels import linking as l; l._Part.compile = lambda self, args: 1 / 0",
        "division by zero",
    ),
    "contexts that are made in another way": (
        "from copied._kernels import signatures as s; s.Target.__init__ = lambda self: None",
        "TypeError: ",
    ),
}


@pytest.mark.parametrize("broken", mostly_slow(BROKEN, quick=3))
def test_whatever_of_numba_has_changed_the_answers_are_the_same(broken, use):
    before, reason = BROKEN[broken]
    found, plain, told, statistics = use(before)
    assert (found, plain) == (EXPECTED, True)
    (line,) = told
    assert reason in line
    assert "install 'numba>=0.63,<0.69'" in line
    assert "\n" not in line
    assert statistics["compiled"] > 5  # what kernels call is compiled by itself, too
    found, _, told, statistics = use(before)
    assert found == EXPECTED
    assert len(told) == 1
    assert statistics["loaded"] > 0


def test_kernels_that_were_linked_before_something_failed_stay_right(use):
    breaking = "from copied._kernels import linking as l; l._PartCompiler._use = lambda *_: 1 / 0"
    use()  # all is in the cache of linked kernels
    found, plain, told, _ = use(between=f"{breaking}; shapes.scaled(disc, 1)")
    assert (found, plain, len(told)) == (EXPECTED, True, 1)


def test_linked_and_plain_kernels_are_kept_apart(use):
    assert use()[3]["compiled"] == 5
    assert use(BROKEN["a newer version"][0])[3]["loaded"] == 0
    assert use()[3] == {"loaded": 5, "compiled": 0}


def test_without_a_compiler_nothing_is_said_of_its_version(tmp_path):
    copy_machinery(tmp_path, shapes=SHAPES)
    code = USE.format(folder=str(tmp_path), before=BROKEN["a newer version"][0], between="pass")
    found, plain, told, statistics = in_another_process(code, NUMBA_DISABLE_JIT="1")
    assert (found, plain, told) == (EXPECTED, False, [])
    assert statistics == {"loaded": 0, "compiled": 0}


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")
def test_a_kernel_that_is_wrong_itself_raises_its_own_error():
    @kernel
    def wrong(x):
        return x.nothing_of_the_kind

    with pytest.raises(TypingError, match="nothing_of_the_kind"):
        wrong(1.0)
    assert not fallback.is_plain()
    doubled = inner_kernel(lambda x: 2.0 * x)
    assert doubled(1.0) == 2.0


@pytest.mark.slow
def test_a_plan_with_a_version_that_is_not_tested(tmp_path, capsys):
    wanted = [*FEW_KERNELS, "--json"]
    assert run(wanted) == 0
    expected = json.loads(capsys.readouterr().out)
    newer = BROKEN["a newer version"][0]
    code = f"{newer}\nfrom terrapath.cli.main import run\nrun({wanted})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    (line,) = done.stderr.splitlines()
    assert "numba 0.99.0 is not a version they are tested with" in line
    found = json.loads(done.stdout)
    np.testing.assert_allclose(found["path"], expected["path"], rtol=1e-9)
