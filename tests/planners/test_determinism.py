"""The same seed gives the same bits, in any process, with any cache and any chunk size."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

import terrapath as tp
from kernel_copies import KERNELS, copy_machinery
from planner_oracles import TREE_PLANNERS
from processes import in_another_process
from reruns import SEARCHES, problems, searches
from terrapath._kernels import cache
from terrapath.planners import rrt_star
from terrapath.problem import scenes


@pytest.fixture(scope="module")
def here():
    return searches()


@pytest.fixture(scope="module")
def cold_and_warm(tmp_path_factory):
    """Two processes, one after the other, that share a kernel cache which was empty."""
    cache = str(tmp_path_factory.mktemp("kernels"))
    return [in_another_process(SEARCHES, NUMBA_CACHE_DIR=cache) for _ in range(2)]


def assert_same_bits(a, b):
    assert a.samples == b.samples
    assert a.cost == b.cost
    assert a.counters == b.counters
    np.testing.assert_array_equal(a.path.points, b.path.points)
    np.testing.assert_array_equal(a.tree.points, b.tree.points)
    np.testing.assert_array_equal(a.tree.parents, b.tree.parents)
    np.testing.assert_array_equal(a.tree.costs, b.tree.costs)


# The same seed


@pytest.mark.parametrize("name", TREE_PLANNERS)
def test_the_same_seed_gives_the_same_bits_and_another_seed_others(name):
    problem = problems()["peaks"]
    first, second = (tp.plan(problem, name, samples=2000, seed=3) for _ in range(2))
    assert_same_bits(first, second)
    assert first.cost != tp.plan(problem, name, samples=2000, seed=4).cost


def test_no_global_random_state_is_read_or_changed():
    problem = problems()["peaks"]
    np.random.seed(1)  # noqa: NPY002 (the global generator is what is tested)
    state = np.random.get_state()[1].copy()  # noqa: NPY002
    first = tp.RRTStar(samples=500).solve(problem)
    np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002
    np.random.seed(2)  # noqa: NPY002
    assert_same_bits(first, tp.RRTStar(samples=500).solve(problem))


@pytest.mark.parametrize("name", ["rrt-star-r", "rrt-star"])
@pytest.mark.parametrize("chunk", [1, 97, 5000])
def test_the_chunk_size_changes_no_bit(name, chunk, monkeypatch):
    problem = problems()["peaks"]
    expected = tp.plan(problem, name, samples=1300, seed=9)
    monkeypatch.setattr(rrt_star, "CHUNK", chunk)
    found = tp.plan(problem, name, samples=1300, seed=9)
    assert_same_bits(expected, found)
    assert len(found.history.samples) == -(-1300 // chunk)


@pytest.mark.parametrize("chunk", [1, 97, 5000])
def test_the_chunk_size_does_not_change_the_path_of_rrt(chunk, monkeypatch):
    problem = problems()["peaks"]
    expected = tp.RRT(samples=5000, seed=9).solve(problem)
    monkeypatch.setattr(rrt_star, "CHUNK", chunk)
    found = tp.RRT(samples=5000, seed=9).solve(problem)
    np.testing.assert_array_equal(expected.path.points, found.path.points)
    assert expected.cost == found.cost


@pytest.mark.parametrize(
    "options", [{}, {"radius_factor": 0.5}, {"informed": False}, {"step": 0.3}]
)
def test_a_longer_run_begins_as_the_shorter_one(options, monkeypatch):
    problem = scenes.load("six-peaks")
    for seed in range(6):
        for samples in (300, 700):
            monkeypatch.setattr(rrt_star, "CHUNK", samples)
            short = tp.RRTStar(samples=samples, seed=seed, **options).solve(problem)
            long = tp.RRTStar(samples=8 * samples, seed=seed, **options).solve(
                problem, callback=lambda progress, n=samples: progress.samples >= n
            )
            assert long.samples == samples
            np.testing.assert_array_equal(long.tree.points, short.tree.points)
            np.testing.assert_array_equal(long.tree.parents, short.tree.parents)
            np.testing.assert_array_equal(long.tree.costs, short.tree.costs)


# Other processes


def test_another_process_finds_the_same_bits(here):
    found, statistics = in_another_process(SEARCHES)
    assert found == here
    assert statistics["loaded"] + statistics["compiled"] > 0


@pytest.mark.slow
def test_kernels_compiled_afresh_find_the_same_bits_as_kernels_from_the_cache(here, cold_and_warm):
    (cold, cold_statistics), (warm, _) = cold_and_warm
    assert cold_statistics["compiled"] > 0
    assert cold == here
    assert warm == here


@pytest.mark.slow
def test_a_second_process_compiles_nothing(cold_and_warm):
    (_, cold), (_, warm) = cold_and_warm
    assert cold["compiled"] > 0
    assert warm["compiled"] == 0
    assert warm["loaded"] > 0


def test_plain_python_agrees_with_the_compiled_kernels(here):
    found, statistics = in_another_process(SEARCHES, NUMBA_DISABLE_JIT="1")
    assert statistics == {"loaded": 0, "compiled": 0}
    assert found["trees"].keys() == here["trees"].keys()
    for case, expected in here["trees"].items():
        tree = found["trees"][case]
        assert tree["parents"] == expected["parents"], case
        assert tree["counters"] == expected["counters"], case
        for key in ("points", "costs", "path", "cost", "length"):
            np.testing.assert_allclose(tree[key], expected[key], rtol=1e-9, atol=1e-9)
    for case, expected in here["rough ground"].items():
        np.testing.assert_allclose(found["rough ground"][case], expected, rtol=1e-9, atol=1e-9)


# The stamp of the cache


@pytest.fixture
def copied_kernels(tmp_path):
    """All kernel modules, and one in a sub-folder."""
    copied = tmp_path / "kernels"
    shutil.copytree(KERNELS, copied, ignore=shutil.ignore_patterns("__pycache__"))
    (copied / "deep" / "down").mkdir(parents=True)
    (copied / "deep" / "down" / "added.py").touch()
    return copied


def test_a_comment_in_any_kernel_module_changes_the_stamp(copied_kernels):
    stamps = {cache.package_stamp(copied_kernels)}
    sources = sorted(copied_kernels.rglob("*.py"))
    for source in sources:
        source.write_text(source.read_text() + "# changed\n")
        stamps.add(cache.package_stamp(copied_kernels))
    assert len(stamps) == len(sources) + 1


def test_the_stamp_is_of_the_names_too_and_the_same_wherever_the_kernels_are(copied_kernels):
    shutil.rmtree(copied_kernels / "deep")
    assert cache.package_stamp(copied_kernels) == cache.STAMP == cache.package_stamp()
    (copied_kernels / "vec4.py").rename(copied_kernels / "vec5.py")
    assert cache.package_stamp(copied_kernels) != cache.STAMP


CALLEE = "@kernel\ndef callee(x):\n    return x + {}\n"
CALLER = (
    "from copied._kernels.{} import callee\n\n@kernel\ndef caller(x):\n    return 2.0 * callee(x)\n"
)
CALL = (
    "import json, sys, warnings; sys.path.insert(0, {!r})\n"
    "import numba; numba.__version__ = {!r} or numba.__version__\n"
    "warnings.simplefilter('ignore')\n"
    "from copied._kernels.caller import caller\n"
    "from copied._kernels.compiler import cache_statistics, is_plain\n"
    "print(json.dumps([caller(3.0), cache_statistics(), is_plain()]))"
)


@pytest.mark.parametrize("version", ["", "99.0"])
@pytest.mark.parametrize("folder", ["", "surface"])
def test_an_edited_callee_in_another_module_makes_its_caller_stale(folder, version, tmp_path):
    callee = f"{folder}.callee".lstrip(".")
    modules = {callee.replace(".", "__"): CALLEE.format("1.0"), "caller": CALLER.format(callee)}
    kernels = copy_machinery(tmp_path, **modules)
    call = CALL.format(str(tmp_path), version)
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    value, statistics, plain = in_another_process(call, **environment)
    assert (value, plain) == (8.0, bool(version))
    assert statistics["compiled"] > 0
    value, statistics, _ = in_another_process(call, **environment)
    assert (value, statistics["compiled"]) == (8.0, 0)
    source = kernels / f"{callee.replace('.', '/')}.py"
    source.write_text(source.read_text().replace("1.0", "10.0"))
    value, statistics, _ = in_another_process(call, **environment)
    assert value == 26.0
    assert statistics["compiled"] > 0
