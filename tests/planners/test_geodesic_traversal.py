"""Geodesic traversal: the fan of rays, and the geodesics that hit the goal exactly."""

from __future__ import annotations

import functools
import json
import math
from itertools import pairwise

import numpy as np
import pytest
import shapely

import terrapath as tp
from common import mostly_slow
from oracles import geodesic_by_collocation, geodesic_by_hamilton, peaks_jets
from terrapath.cli.main import run
from terrapath.geodesics.rays import is_bracket, trace_ray
from terrapath.planners import geodesic_traversal
from terrapath.problem import scenes

SCENES = {
    "one-peak": [scenes.ONE_PEAK],
    "three-peaks": [scenes.THREE_PEAKS],
    "six-peaks": [scenes.FOUR_PEAKS, scenes.TWO_RESISTANCE_PEAKS],
    "four-peaks": [scenes.FOUR_PEAKS],
    "repeat-3d": [scenes.REPEAT_HEIGHT],
    "repeat-4d": [scenes.REPEAT_HEIGHT, scenes.REPEAT_RESISTANCE],
}
EVERY_SCENE = pytest.mark.parametrize("scene", SCENES)


@functools.cache
def fan_of(scene, directions=400):
    return tp.GeodesicTraversal(directions=directions).fan(scenes.load(scene))


@functools.cache
def solved(scene, directions=400):
    return tp.GeodesicTraversal(directions=directions).solve(scenes.load(scene))


def sampled(points, count=257):
    return points[np.unique(np.linspace(0, len(points) - 1, count).astype(int))]


def same_curve(a, b):
    """Largest distance from the points of one curve to the other."""
    line = shapely.LineString(a)
    return max(line.distance(shapely.Point(p)) for p in sampled(b, 65))


# The geodesics of the fan


@pytest.mark.parametrize("scene", mostly_slow(SCENES, quick=3))
def test_every_geodesic_ends_at_the_goal_and_is_a_geodesic(scene):
    geodesics = fan_of(scene).geodesics
    assert geodesics
    lengths = [g.length for g in geodesics]
    assert lengths == sorted(lengths)
    angles = np.sort([g.angle for g in geodesics])
    assert (np.diff(angles) > 1e-9).all()
    jets = peaks_jets(SCENES[scene])
    for k, geodesic in enumerate(geodesics):
        assert math.dist(geodesic.points[0], scenes.START) == 0.0
        # Rounding turns a ray by some 1e-15, which its Jacobi field magnifies: 4e5 times at worst.
        rounding = 1e-14 * abs(geodesic.jacobi_at_goal)
        assert math.dist(geodesic.points[-1], scenes.GOAL) <= max(1e-9, rounding)
        if k < 5:
            ends = geodesic_by_hamilton(jets, scenes.START, geodesic.angle, [geodesic.length])
            most = 1e-10 * (1.0 + abs(geodesic.jacobi_at_goal))
            assert math.dist(ends[0], scenes.GOAL) <= max(most, 1e-9)


@EVERY_SCENE
def test_the_shortest_geodesics_are_as_long_as_solve_bvp_says(scene):
    jets = peaks_jets(SCENES[scene])
    for geodesic in fan_of(scene).geodesics[:3]:
        guess = sampled(geodesic.points)
        t = np.linspace(0.0, 1.0, len(guess))[:, None]
        guess = guess + 0.02 * np.sin(math.pi * t) * (1.0, -1.0)
        length, _ = geodesic_by_collocation(jets, guess, 1e-8)
        assert length == pytest.approx(geodesic.length, rel=1e-10)


@EVERY_SCENE
def test_no_curve_that_solve_bvp_starts_from_leads_to_a_shorter_geodesic(scene):
    jets = peaks_jets(SCENES[scene])
    best = fan_of(scene).geodesics[0].length
    t = np.linspace(0.0, 1.0, 201)[:, None]
    found = []
    for bulge in (-4.0, 0.5, 3.0):
        guess = 10.0 * t + bulge * np.sin(math.pi * t) * (1.0, -1.0)
        answer = geodesic_by_collocation(jets, guess, 1e-4, 1_500)
        if answer is not None:
            found.append(answer[0])
    assert found
    assert min(found) >= best * (1.0 - 1e-7)


def test_the_lengths_are_those_of_the_reference():
    one, six, repeat = (fan_of(s).geodesics for s in ("one-peak", "six-peaks", "repeat-3d"))
    for geodesics, expected in (
        (one, (16.142532164, 18.101518720)),
        (six, (17.018129404, 17.330039313, 17.647767424)),
        (repeat, (15.734152898, 15.745526535)),
    ):
        lengths = np.array([g.length for g in geodesics])
        for length in expected:
            assert np.abs(lengths - length).min() <= 1e-9
        assert lengths[0] == pytest.approx(expected[0], abs=1e-9)
    assert repeat[1].length == pytest.approx(15.745526535, abs=1e-9)
    assert 0.0 < repeat[1].length / repeat[0].length - 1.0 < 0.0008


@pytest.mark.parametrize("scene", mostly_slow(SCENES))
def test_more_directions_never_lose_the_shortest(scene):
    shortest = [fan_of(scene, n).geodesics[0].length for n in (200, 400, 600)]
    assert (np.diff(shortest) <= 1e-9).all()
    # From 400 on it is found.
    np.testing.assert_allclose(shortest[1:], shortest[-1], rtol=1e-10)
    if scene != "repeat-4d":  # whose shortest leaves outside the paper's sector
        assert shortest[1] == pytest.approx(scenes.SCENES[scene].true_length, abs=1e-9)


def test_the_shortest_path_of_repeat_4d_leaves_outside_the_papers_sector():
    problem = scenes.load("repeat-4d")
    fan = tp.GeodesicTraversal(directions=300, sector=(1.4, 1.75)).fan(problem)
    best = fan.geodesics[0]
    assert best.length == pytest.approx(scenes.SCENES["repeat-4d"].true_length, abs=1e-9)
    assert best.angle > math.pi / 2
    assert best.length < fan_of("repeat-4d").geodesics[0].length - 0.1
    answer = geodesic_by_collocation(
        peaks_jets(SCENES["repeat-4d"]), sampled(best.points), 1e-8, 60_000
    )
    assert answer[0] == pytest.approx(best.length, rel=1e-10)


@EVERY_SCENE
def test_the_shortest_is_locally_shortest(scene):
    best = fan_of(scene).geodesics[0]
    assert len(best.conjugate_points) == 0
    surface = scenes.load(scene).surface
    assert tp.curve_length(surface, best.points) == pytest.approx(best.length, rel=1e-5)
    t = np.linspace(0.0, 1.0, len(best.points))[:, None]
    for side in (-0.05, 0.05):
        moved = best.points + side * np.sin(math.pi * t) * (1.0, -1.0)
        assert tp.curve_length(surface, moved) > best.length


@pytest.mark.parametrize(
    ("scene", "mirror"),
    [
        ("one-peak", lambda points: points[:, ::-1]),
        ("four-peaks", lambda points: points[:, ::-1]),
        ("six-peaks", lambda points: 10.0 - points[::-1]),
    ],
)
def test_a_symmetric_scene_has_mirrored_twins(scene, mirror):
    first, second = fan_of(scene).geodesics[:2]
    assert first.length == pytest.approx(second.length, rel=1e-12)
    assert same_curve(first.points, second.points) > 0.1
    assert same_curve(mirror(first.points), second.points) <= 1e-4


# The solution


@EVERY_SCENE
def test_the_solution_is_the_shortest_geodesic_from_start_to_goal(scene):
    solution, fan = solved(scene), fan_of(scene)
    assert solution.status is tp.Status.SOLVED
    assert solution.planner == "geodesic-traversal"
    assert solution.samples == 400
    np.testing.assert_array_equal(solution.path.points[0], scenes.START)
    np.testing.assert_array_equal(solution.path.points[-1], scenes.GOAL)
    assert solution.cost == fan.geodesics[0].length
    assert 0.0 <= solution.length / solution.cost - 1.0 <= 1e-5
    assert len(solution.alternatives) == len(fan.geodesics) - 1
    for path, geodesic in zip(solution.alternatives, fan.geodesics[1:], strict=True):
        assert path.length == pytest.approx(geodesic.length, rel=1e-4)
    assert solution.stopped_by == f"400 rays, {len(fan.geodesics)} geodesics"


def test_the_papers_answer_is_the_shortest_ray_that_passes_near_the_goal():
    fan = fan_of("six-peaks", 600)
    problem = scenes.load("six-peaks")
    assert fan.radius == pytest.approx(0.5)
    assert len(fan.rays) == len(fan.angles) == 600
    assert fan.angles[0] == pytest.approx(0.0, abs=1e-15)
    assert fan.angles[-1] == pytest.approx(0.5 * math.pi)
    np.testing.assert_allclose(np.diff(fan.angles), 0.5 * math.pi / 599)
    nearest, lengths = [], []
    for ray in fan.rays:
        fine = trace_ray(
            problem.surface, (0, 0), ray.angle, ray.length, bounds=problem.bounds, longest_step=0.02
        )
        away = np.hypot(*(fine.points - scenes.GOAL).T)
        nearest.append(away.min())
        lengths.append(fine.arc_length[away.argmin()])
    nearest, lengths = np.array(nearest), np.array(lengths)
    np.testing.assert_allclose(fan.closest, nearest, rtol=0, atol=0.01)
    clear = np.abs(nearest - fan.radius) > 0.01
    np.testing.assert_array_equal(fan.near[clear], (nearest <= fan.radius)[clear])
    assert fan.near.any()
    assert fan.paper_length == pytest.approx(lengths[fan.near].min(), abs=0.02)
    assert fan.near[fan.paper_ray]
    assert fan.misses[fan.paper_ray].arc_length == fan.paper_length


# Obstacles, and goals that no ray comes near


def test_geodesics_through_an_obstacle_are_left_out():
    surface = tp.Surface.from_peaks([scenes.ONE_PEAK])
    plain = fan_of("one-peak", 200).geodesics
    left, right = (g.points[len(g.points) // 2] for g in plain[:2])
    for blocked, expected in (
        ([left], plain[1:]),
        ([left, right], plain[2:]),
        ([left, right, (5.0, 5.0)], ()),
    ):
        boxes = [shapely.Point(p).buffer(0.3) for p in blocked]
        problem = tp.Problem(surface, scenes.START, scenes.GOAL, scenes.REGION, boxes)
        planner = tp.GeodesicTraversal(directions=200)
        found = planner.fan(problem).geodesics
        assert [g.length for g in found] == [g.length for g in expected]
        assert all(not shapely.LineString(g.points).intersects(b) for g in found for b in boxes)
        status = tp.Status.SOLVED if expected else tp.Status.NOT_FOUND
        with pytest.warns(tp.GroundWarning, match="no ray goes round an obstacle; optimal"):
            assert planner.solve(problem).status is status


def test_on_rough_ground_it_says_that_routes_may_be_missed():
    random, axis = np.random.default_rng(4), 10.0 * np.arange(20)
    rough = tp.Surface.from_grid(30.0 * random.standard_normal((20, 20)), axis, axis)
    problem = tp.Problem(rough, (20.0, 30.0), (150.0, 160.0))
    with pytest.warns(tp.GroundWarning, match="on rough ground rays miss routes; optimal looks"):
        tp.GeodesicTraversal(directions=10).solve(problem)


def test_a_sector_away_from_the_goal_finds_nothing_and_says_how_near_it_came():
    problem = scenes.load("six-peaks")
    planner = tp.GeodesicTraversal(directions=20, sector=(3.2, 4.6))
    solution, fan = planner.solve(problem), planner.fan(problem)
    assert solution.status is tp.Status.NOT_FOUND
    assert solution.path is solution.cost is solution.length is None
    assert solution.alternatives == fan.geodesics == ()
    assert fan.paper_ray is fan.paper_length is None
    k = int(np.argmin(fan.closest))
    assert fan.closest[k] > 10.0
    assert f"closest of 20 passes it at {fan.closest[k]:.4g}" in solution.stopped_by
    assert f"angle {fan.angles[k]:.4f} rad" in solution.stopped_by


def test_where_the_start_is_the_goal_there_is_nothing_to_do():
    surface = tp.Surface.from_peaks([scenes.ONE_PEAK])
    solution = tp.plan(tp.Problem(surface, (3, 4), (3, 4), scenes.REGION), "geodesic-traversal")
    assert solution.status is tp.Status.SOLVED
    assert solution.length == solution.cost == 0.0


@pytest.mark.parametrize("goal", [(10.0, 0.0), (-0.5, 7.0), (3.0, 3.0)])
def test_on_flat_ground_the_geodesic_is_the_straight_line(goal):
    problem = tp.Problem(tp.Surface.from_peaks([[]]), (0, 0), goal, scenes.REGION)
    solution = tp.GeodesicTraversal(directions=20).solve(problem)
    assert solution.cost == pytest.approx(math.hypot(*goal), rel=1e-12)
    assert solution.alternatives == ()
    assert same_curve([(0, 0), goal], solution.path.points) <= 1e-9


@pytest.mark.parametrize(("scale", "shift"), [(1e3, (5e5, 4.5e6)), (1e-3, (0.0, 0.0))])
def test_the_units_and_the_origin_of_the_map_do_not_matter(scale, shift):
    a, falloff, x, y = scenes.ONE_PEAK[0]
    moved = (a * scale, falloff / scale**2, x * scale + shift[0], y * scale + shift[1])
    ends = [tuple(scale * c + d for c, d in zip(p, shift, strict=True)) for p in ((0, 0), (10, 10))]
    bounds = [scale * c + d for c, d in zip(scenes.REGION, shift * 2, strict=True)]
    problem = tp.Problem(tp.Surface.from_peaks([[moved]]), *ends, bounds)
    solution = tp.GeodesicTraversal(directions=100).solve(problem)
    assert solution.cost == pytest.approx(scale * 16.142532164, rel=1e-9)
    assert len(solution.alternatives) == 2


# What ends it early


def interrupt(*_, **__):
    raise KeyboardInterrupt


def test_ctrl_c_while_the_first_geodesic_is_solved_for_leaves_the_rays(monkeypatch):
    monkeypatch.setattr(geodesic_traversal, "hit", interrupt)
    solution = tp.GeodesicTraversal(directions=40).solve(scenes.load("one-peak"))
    assert solution.status is tp.Status.INTERRUPTED
    assert solution.path is None
    assert 2 <= solution.samples <= 40


def test_ctrl_c_while_a_later_geodesic_is_solved_for_keeps_those_before(monkeypatch):
    whole = fan_of("one-peak", 40).geodesics
    hit, calls = geodesic_traversal.hit, []

    def hit_once(*arguments, **options):
        calls.append(arguments)
        return hit(*arguments, **options) if len(calls) == 1 else interrupt()

    monkeypatch.setattr(geodesic_traversal, "hit", hit_once)
    fan = tp.GeodesicTraversal(directions=40).fan(scenes.load("one-peak"))
    assert fan.interrupted
    assert len(whole) > len(fan.geodesics) == 1
    assert fan.geodesics[0].length in [geodesic.length for geodesic in whole]
    assert len(fan.rays) == len(fan.misses) < 40


def test_the_callback_sees_each_geodesic_and_ends_the_fan_there():
    problem, seen = scenes.load("one-peak"), []

    def stop_once_there_is_a_path(progress):
        seen.append(progress.best_cost)
        return progress.best_cost < math.inf

    solution = tp.GeodesicTraversal(directions=40).solve(
        problem, callback=stop_once_there_is_a_path
    )
    assert seen[:-1] == [math.inf] * (len(seen) - 1)
    assert solution.status is tp.Status.SOLVED
    assert solution.cost == seen[-1]
    assert solution.samples == len(seen) < 40


@pytest.mark.parametrize(
    ("start", "goal"),
    [((0, 1), (0.5, 9)), ((0, 0), (9, 10)), ((10, 0), (10, 9)), ((4, 10), (5, 0.5))],
)
def test_from_the_edge_of_the_bounds_the_geodesics_are_those_of_wider_bounds(start, goal):
    surface = tp.Surface.from_peaks([[(1.0, 0.1, 5.0, 5.0)]])
    planner = tp.GeodesicTraversal(directions=60)
    near, wide = (
        planner.fan(tp.Problem(surface, start, goal, bounds)).geodesics
        for bounds in ((0, 0, 10, 10), (-5, -5, 15, 15))
    )
    inside = [g.length for g in wide if g.points.min() >= -1e-12 and g.points.max() <= 10.0 + 1e-12]
    assert [g.length for g in near] == pytest.approx(inside, rel=1e-11)


@pytest.mark.parametrize("cost", [1e-3, 10.0, 1e4])
def test_a_constant_cost_leaves_the_fan_as_it_is(cost):
    axis = np.linspace(0.0, 10.0, 41)
    hill = 2.0 * np.exp(-0.4 * ((axis[:, None] - 5.2) ** 2 + (axis - 5.0) ** 2))
    one, other = (
        tp.GeodesicTraversal(directions=30).fan(tp.Problem(surface, (1, 1), (9, 9)))
        for surface in (
            tp.Surface.from_grid([hill, np.full_like(hill, c)], axis, axis, kinds=["rise", "cost"])
            for c in (1.0, cost)
        )
    )
    np.testing.assert_allclose(other.closest, one.closest, rtol=0.0, atol=0.01)
    brackets = [[is_bracket(*pair) for pair in pairwise(fan.misses)] for fan in (one, other)]
    assert brackets[0] == brackets[1]
    assert any(brackets[0])
    rows = [np.array([len(ray.points) for ray in fan.rays]) for fan in (one, other)]
    assert (rows[1] <= 4 * rows[0]).all()


# Options


@pytest.mark.parametrize(
    "options",
    [
        {"directions": 1},
        {"directions": 0},
        {"directions": -5},
        {"directions": 2.5},
        {"sector": (1.0, 0.0)},
        {"sector": (1.0, 1.0)},
        {"sector": (0.0, math.nan)},
        {"sector": (-math.inf, 0.0)},
        {"sector": (0.0, 1.0, 2.0)},
        {"sector": (0.0,)},
        {"sector": 1.0},
        {"sector": ("a", "b")},
        {"radius": 0.0},
        {"radius": math.nan},
        {"tolerance": 0.0},
        {"tolerance": -1.0},
        {"tolerance": math.nan},
    ],
    ids=str,
)
def test_an_option_that_cannot_be_used_is_refused_by_name(options):
    ((name, _),) = options.items()
    with pytest.raises(tp.InputError, match=name):
        tp.GeodesicTraversal(**options)


# The command


def test_the_command_prints_the_exact_length_as_the_cost(capsys):
    code = run(["plan", "six-peaks", "--planner", "geodesic-traversal", "--json"])
    captured = capsys.readouterr()
    answer = json.loads(captured.out)
    assert code == 0
    assert captured.err == ""
    assert (answer["status"], answer["planner"]) == ("solved", "geodesic-traversal")
    assert answer["cost"] == pytest.approx(17.018129404, abs=1e-9)
    assert 0.0 <= answer["length"] / answer["cost"] - 1.0 <= 1e-5
    assert (answer["path"][0], answer["path"][-1]) == ([0.0, 0.0], [10.0, 10.0])
    assert answer["samples"] == 600
