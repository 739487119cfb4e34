"""Long work asks whether it must stop, and ends with what it has; no test looks at a clock."""

import math

import numpy as np
import pytest
import shapely

import terrapath as tp
from terrapath._support import watching
from terrapath.certificates import claims, search
from terrapath.geodesics import alternatives, rays
from terrapath.planners import base, finish, finished, grid_search, make_planner, optimal

SIDE = 40


def rough_surface(weight=10.0):
    random, frequency = np.random.default_rng(5), np.fft.fftfreq(SIDE)
    size = np.hypot(frequency[:, None], frequency)
    size[0, 0] = 1.0
    noise = np.fft.fft2(random.standard_normal((SIDE, SIDE)))
    heights = np.fft.ifft2(noise * size**-1.8).real
    heights *= 8.0 / np.ptp(heights)
    axis = np.arange(float(SIDE))
    return tp.Surface.from_grid(heights, axis, axis, weights=[weight])


@pytest.fixture(scope="module")
def open_ground():
    return tp.Problem(rough_surface(), (3.0, 3.0), (36.0, 33.0))


@pytest.fixture(scope="module")
def among_boxes():
    corners = np.random.default_rng(2).uniform(5.0, 32.0, (30, 2))
    boxes = shapely.union_all(shapely.box(*corners.T, *(corners + 2.5).T))
    return tp.Problem(rough_surface(), (3.0, 3.0), (36.0, 36.0), obstacles=[boxes])


@pytest.fixture(scope="module", params=["open_ground", "among_boxes"])
def problem(request):
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="module")
def raw(problem):
    return tp.plan(problem, "dijkstra", spacing=1.5).path


@pytest.fixture(scope="module")
def whole(problem, raw):
    """The whole refinement: its path, and how often it asked."""
    looks = Counter()
    return tp.refine(problem, raw, must_stop=looks), looks.looks


class Counter:
    """Says stop from a look on, and counts the looks."""

    def __init__(self, stop_at=math.inf):
        self.stop_at, self.looks = stop_at, 0

    def __call__(self):
        self.looks += 1
        return self.looks >= self.stop_at


class Clock:
    """A clock that moves by a step each time somebody looks at it."""

    def __init__(self, step):
        self.now, self.step = 0.0, step

    def perf_counter(self):
        self.now += self.step
        return self.now


def test_a_limit_in_seconds_ends_when_they_are_over(monkeypatch):
    monkeypatch.setattr(watching, "time", Clock(1.0))
    must_stop = watching.stop_after(2.5)
    assert [must_stop() for _ in range(4)] == [False, False, True, True]
    asked = Counter(2)
    either = watching.stop_after(100.0, asked)
    assert [either() for _ in range(3)] == [False, True, True]
    assert not watching.never()


# Refinement


def test_refinement_asks_at_every_step(problem, raw, whole):
    refined, looks = whole
    assert looks > 20
    np.testing.assert_array_equal(refined.points, tp.refine(problem, raw).points)


def test_a_refinement_that_is_stopped_has_the_best_path_so_far(problem, raw, whole):
    (best, most), lengths = whole, []
    for share in (0.0, 0.1, 0.3, 0.6, 0.9, 1.1):
        looks = Counter(1 + int(share * most))
        path = tp.refine(problem, raw, must_stop=looks)
        assert problem.free_space.allows(path.points)
        assert tuple(path.points[0]) == problem.start
        assert tuple(path.points[-1]) == problem.goal
        assert path.length <= raw.length * (1.0 + 1e-12)
        # A few more looks while the loops around it end.
        assert looks.looks <= looks.stop_at + 12 + len(path.points)
        lengths.append(path.length)
    assert lengths[0] == pytest.approx(raw.length, rel=1e-12)
    assert lengths[-1] == best.length
    assert min(lengths[1:-1]) < raw.length


def test_a_refinement_without_time_returns_its_path(problem, raw):
    path = tp.refine(problem, raw, time_limit=1e-9)
    np.testing.assert_array_equal(path.points, raw.points)
    with pytest.raises(tp.InputError, match="time_limit=0"):
        tp.refine(problem, raw, time_limit=0)


# Bounds


@pytest.mark.parametrize("stop_at", [1, 2, 3, 40, 130, 150, 400])
def test_a_bound_that_is_stopped_holds(problem, whole, stop_at):
    looks, length = Counter(stop_at), whole[0].length
    found = list(search.certificates(problem, length, must_stop=looks))
    chord = float(tp.chord(problem.surface, problem.start, problem.goal))
    for certificate in found[-1:]:
        assert certificate.check(problem) == certificate.value
        assert chord * (1.0 - 1e-8) <= certificate.value <= length


def test_the_search_for_a_bound_ends_soon(problem, raw, monkeypatch):
    looks = Counter(1)
    monkeypatch.setattr(search, "stop_after", lambda _: looks)
    found = tp.lower_bound(problem, length=raw.length, target_gap=1e-9, time_limit=1.0)
    rows = found.coefficients.shape[0] - 3
    assert looks.looks <= rows + 8
    assert found.check(problem) == found.value


def test_proofs_ask_row_by_row_and_lose_nothing(open_ground):
    made = search.Search(open_ground, tp.Lattice(open_ground.bounds, 40, 30), math.inf)
    looks = Counter()
    needs = claims.cell_needs(open_ground, made.proposal, 0.5, looks)
    assert looks.looks == 29
    norm = claims.proven_norm(open_ground, made.proposal, needs.proven)
    for stop_at in (1, 2, 3, 10):
        stopped = Counter(stop_at)
        some = claims.cell_needs(open_ground, made.proposal, 0.5, Counter(stop_at))
        assert (some.proven >= needs.proven).all()
        np.testing.assert_array_equal(some.proven[: stop_at - 1], needs.proven[: stop_at - 1])
        weaker = claims.proven_norm(open_ground, made.proposal, needs.proven, 0.0, stopped)
        assert weaker >= norm
        assert stopped.looks <= stop_at


def test_without_time_the_bound_is_at_least_the_chord(problem):
    found = tp.lower_bound(problem, time_limit=1e-9)
    assert found.check(problem) == found.value
    chord = float(tp.chord(problem.surface, problem.start, problem.goal))
    assert found.value >= chord * (1.0 - 1e-8)


# Planners


@pytest.mark.parametrize("name", ["dijkstra", "fast-marching", "rrt-star"])
def test_a_plan_without_time_for_its_bound_has_one(name, problem):
    # The search has all the time that it wants, the finishing has none.
    found = make_planner(name).solve(problem)
    finished = finish(found, refine=True, target_gap=1e-9, time_limit=1e-9)
    assert finished.status is tp.Status.SOLVED
    assert 0.0 < finished.lower_bound <= finished.length <= found.length * (1.0 + 1e-12)
    assert finished.certificate.check(problem) == finished.lower_bound


def test_finishing_hands_on_what_is_left_of_the_time(open_ground, monkeypatch):
    seen = []

    def note(name, work):
        def noted(*args, time_limit=None, **options):
            seen.append((name, time_limit))
            return work(*args, **options)

        monkeypatch.setattr(finished, name, noted)

    note("refine", finished.refine)
    note("lower_bound", finished.lower_bound)
    tp.plan(open_ground, "dijkstra", spacing=2.0, refine=True, bound=True, time_limit=1000.0)
    (first, refining), (second, proving) = seen
    assert (first, second) == ("refine", "lower_bound")
    assert 0.0 < refining < 800.0 < proving < 1000.0  # a fifth is kept for the bound
    tp.plan(open_ground, "dijkstra", spacing=2.0, refine=True, bound=True)
    assert [limit for _, limit in seen[2:]] == [None, None]


def test_optimal_refines_and_proves_by_its_clock(open_ground, monkeypatch):
    refine, prove = alternatives.refine, optimal.with_bound
    clocks, limits = [], []

    def refine_noted(*args, must_stop, **options):
        clocks.append(must_stop)
        return refine(*args, must_stop=must_stop, **options)

    def prove_noted(*args, time_limit, **options):
        limits.append(time_limit)
        return prove(*args, **{**options, "target_gap": 10.0})

    monkeypatch.setattr(alternatives, "refine", refine_noted)
    monkeypatch.setattr(optimal, "with_bound", prove_noted)
    tp.plan(open_ground, "optimal", spacing=2.0, routes=1, time_limit=1000.0)
    assert clocks
    assert not any(is_late() for is_late in clocks)
    assert 0.0 < limits[0] < 1000.0


def test_a_stopper_is_late_whatever_the_callback_says(monkeypatch):
    monkeypatch.setattr(base, "time", Clock(1.0))
    stopper = base.Stopper(lambda _: False, 2.5)
    assert stopper.seconds_left == 1.5
    assert [stopper.is_late() for _ in range(2)] == [False, True]
    assert stopper.stopped_by == "time limit"
    assert stopper.seconds_left == base.MOMENT
    assert base.Stopper(None, None).seconds_left is None
    assert not base.Stopper(None, None).is_late()


# A start in a pocket that only far nodes are seen from: its many edges are relaxed row by row.
POCKET = shapely.box(20.2, 20.2, 20.8, 20.8).exterior.difference(
    shapely.box(20.7, 20.499, 21, 20.501)
)


@pytest.mark.parametrize("stop_at", [1, 3, 10, 40])
def test_a_grid_search_looks_at_the_clock_while_it_joins_its_ends(stop_at, monkeypatch):
    problem = tp.Problem(rough_surface(), (20.3, 20.63), (30.0, 30.0), obstacles=[POCKET])
    looks = Counter(stop_at)
    monkeypatch.setattr(grid_search._Search, "is_late", property(lambda _: looks()))
    solution = tp.plan(problem, "a-star", spacing=1.0, time_limit=1000.0)
    assert solution.stopped_by == "time limit"
    assert solution.path is None
    assert solution.samples == 0
    assert looks.looks <= stop_at + 60


def test_the_search_for_a_geodesic_between_two_rays_asks(open_ground):
    surface, start = open_ground.surface, open_ground.start
    goal = np.array([9.0, 8.0])
    towards = math.atan2(*(goal - start)[::-1])
    length = 3.0 * float(tp.line_r(surface, start, goal))
    misses = [
        rays.closest_approach(
            rays.trace_ray(surface, start, towards + turn, length, bounds=open_ground.bounds), goal
        )
        for turn in (-0.7, 0.7)
    ]
    looks = Counter()
    rays.hit(surface, start, goal, misses, bounds=open_ground.bounds, must_stop=looks)
    assert looks.looks > 0
    stopped = Counter(1)
    found = rays.hit(surface, start, goal, misses, bounds=open_ground.bounds, must_stop=stopped)
    assert found is None
    assert stopped.looks == 1
