"""Tours and nearest goals: legs add up, bounds hold, nothing that is not whole is a route."""

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import shapely

import terrapath as tp
from terrapath.io import route_record
from terrapath.planners import (
    Finished,
    Planner,
    Progress,
    finished,
    make_finished,
    nearest,
    plan_goals,
    plan_tour,
)
from terrapath.planners.base import least_limit, stay_put
from terrapath.surface.metric import curve_length

FAST = make_finished("fast-marching", spacing=0.4, refine=True, bound=True)
VIA = [(5.0, 2.0), (3.0, 9.0)]


@pytest.fixture(scope="module")
def problem():
    return tp.scenes.load("six-peaks")


@pytest.fixture(scope="module")
def tour(problem):
    return plan_tour(problem, FAST, VIA)


def test_a_tour_is_its_legs_one_after_another(problem, tour):
    assert tour.status is tp.Status.SOLVED
    ends = [problem.start, *VIA, problem.goal]
    assert [(leg.problem.start, leg.problem.goal) for leg in tour.legs] == list(
        itertools.pairwise(ends)
    )
    assert tour.length == pytest.approx(sum(leg.length for leg in tour.legs), rel=1e-9)
    assert tour.lower_bound == pytest.approx(sum(leg.lower_bound for leg in tour.legs))
    assert tour.lower_bound <= tour.length
    assert tour.cost == pytest.approx(sum(leg.cost for leg in tour.legs))
    assert tour.certificate is None
    assert tour.alternatives == ()
    points = tour.path.points
    assert (np.hypot(*np.diff(points, axis=0).T) > 0.0).all()  # no joint stands twice
    for stop in ends:
        assert (points == stop).all(axis=1).sum() == 1


def test_each_leg_is_what_the_planner_answers_alone(problem, tour):
    for leg in tour.legs:
        alone = FAST.solve(tp.Problem(problem.surface, leg.problem.start, leg.problem.goal,
                                      problem.bounds))  # fmt: skip
        np.testing.assert_array_equal(alone.path.points, leg.path.points)
        assert alone.lower_bound == leg.lower_bound


def test_without_waypoints_a_tour_is_the_planners_own_answer(problem):
    answer, alone = plan_tour(problem, FAST), FAST.solve(problem)
    assert answer.legs == ()
    assert answer.length == alone.length
    assert answer.certificate.value == alone.certificate.value


def test_the_bound_holds_for_other_paths_through_the_waypoints(problem, tour):
    generator = np.random.default_rng(7)
    for _ in range(20):
        bends = [np.clip(stop + generator.normal(0.0, 1.0, 2), -1, 11) for stop in (*VIA, (9, 9))]
        stops = [problem.start, bends[0], VIA[0], bends[1], VIA[1], bends[2], problem.goal]
        assert tp.curve_length(problem.surface, stops) >= tour.lower_bound


def test_the_record_of_a_tour_has_its_legs_and_their_straight_ways(problem, tour):
    record = route_record(tour)
    assert [leg["goal"] for leg in record["legs"]] == [[*stop] for stop in (*VIA, problem.goal)]
    assert [leg["length"] for leg in record["legs"]] == [leg.length for leg in tour.legs]
    straight = curve_length(problem.surface, [problem.start, *VIA, problem.goal])
    assert record["straight_length"] == pytest.approx(straight, rel=1e-8)


def walled(**options):
    surface = tp.Surface.from_peaks([[(1.0, 0.5, 5.0, 5.0)]])
    moat = shapely.Point(8, 8).buffer(2.0).difference(shapely.Point(8, 8).buffer(1.0))
    return tp.Problem(surface, (1, 1), (2, 9), (0, 0, 10, 10), [moat], **options)


@dataclass(frozen=True)
class Counted:
    """A planner that notes what it is asked."""

    planner: Planner
    asked: list

    @property
    def name(self):
        return self.planner.name

    def solve(self, problem, *, callback=None):
        self.asked.append((problem.start, problem.goal))
        return self.planner.solve(problem, callback=callback)


def test_a_waypoint_that_cannot_be_reached_is_found_out_before_anything_is_planned():
    counted = Counted(FAST, [])
    answer = plan_tour(walled(), counted, [(3, 3), (8, 8)])
    assert answer.status is tp.Status.UNREACHABLE
    assert "leg 2 of 3" in answer.stopped_by
    assert answer.path is None
    assert counted.asked == []


def test_a_leg_without_a_path_ends_the_tour(problem):
    poor = make_finished("rrt", samples=3, step=0.05)
    answer = plan_tour(problem, poor, VIA)
    assert answer.status is tp.Status.NOT_FOUND
    assert answer.path is answer.length is answer.lower_bound is None
    assert len(answer.legs) == 1


@pytest.mark.parametrize("which", [0, 1, 2])
def test_an_interrupt_leaves_a_path_only_where_it_reaches_the_goal(problem, which):
    planner = make_finished("rrt-star-r", samples=300)

    @dataclass(frozen=True)
    class Interrupted(Counted):
        def solve(self, leg, *, callback=None):
            found = super().solve(leg, callback=callback)
            if len(self.asked) < which + 1:
                return found
            return replace(found, status=tp.Status.INTERRUPTED, stopped_by="interrupt")

    answer = plan_tour(problem, Interrupted(planner, []), VIA)
    assert answer.status is tp.Status.INTERRUPTED
    assert len(answer.legs) == which + 1
    assert f"leg {which + 1} of 3" in answer.stopped_by
    if which < 2:
        assert answer.path is None
    else:
        assert tuple(answer.path.points[-1]) == problem.goal


def test_an_interrupt_between_two_legs_is_an_answer_too(problem):
    @dataclass(frozen=True)
    class Stopped(Counted):
        def solve(self, leg, *, callback=None):
            if self.asked:
                raise KeyboardInterrupt
            return super().solve(leg, callback=callback)

    answer = plan_tour(problem, Stopped(FAST, []), VIA)
    assert answer.status is tp.Status.INTERRUPTED
    assert answer.path is None
    assert [leg.status for leg in answer.legs] == [tp.Status.SOLVED, tp.Status.INTERRUPTED]


def test_the_callback_is_told_which_leg_it_sees(problem):
    seen: list[Progress] = []
    planner = make_finished("rrt-star-r", samples=600)
    plan_tour(problem, planner, VIA, callback=seen.append)
    assert list(dict.fromkeys(p.leg for p in seen)) == [f"leg {k} of 3" for k in (1, 2, 3)]
    seen.clear()
    plan_tour(problem, planner, callback=seen.append)
    assert {p.leg for p in seen} == {""}


@dataclass(frozen=True)
class Timed:
    """Notes the time limit that it is given for each leg."""

    time_limit: float | None
    limits: list = field(default_factory=list)
    name: str = "timed"

    def solve(self, leg, *, callback=None, time_limit=None):
        self.limits.append(least_limit(self.time_limit, time_limit))
        return stay_put(leg, self.name)


def test_legs_share_the_time_limit(problem):
    planner = Timed(30.0)
    plan_tour(problem, planner, VIA)
    assert planner.limits == pytest.approx([10.0, 15.0, 30.0], abs=1.0)  # of what is left


def test_legs_share_the_time_limit_of_the_planner_within(problem):
    planner, alone = Timed(30.0), Timed(30.0)
    plan_tour(problem, Finished(planner=planner), VIA)
    assert planner.limits == [10.0, 10.0, 10.0]
    plan_tour(problem, Finished(planner=alone))
    assert alone.limits == [30.0]


def test_no_time_limit_is_made_up(problem):
    planner = Timed(None)
    plan_tour(problem, Finished(planner=planner), VIA)
    assert planner.limits == [None, None, None]


def test_a_limit_of_the_planner_within_does_not_limit_finishing(problem, monkeypatch):
    limits = []

    def finish(solution, *, time_limit, **_):
        limits.append(time_limit)
        return solution

    monkeypatch.setattr(finished, "finish", finish)
    plan_tour(problem, Finished(planner=Timed(30.0)), VIA)
    assert limits == [None, None, None]


def test_bad_waypoints_are_named():
    ground = walled()
    for via, words in (
        ([(3, 3), (8, 6.5)], r"via 2=\(8, 6.5\)"),
        ([(30, 3)], r"via 1=\(30, 3\) is outside"),
        ([("a", 3)], "via 1="),
    ):
        with pytest.raises(tp.InputError, match=words):
            plan_tour(ground, FAST, via)
    with pytest.raises(tp.InputError, match=r"goal 2=\(8, 6.5\)"):
        plan_goals(ground, FAST, [(3, 3), (8, 6.5)])
    with pytest.raises(tp.InputError, match="no goal"):
        plan_goals(ground, FAST, [])


# Several goals


def test_the_nearest_goal_is_the_one_that_planning_to_all_finds(problem):
    generator = np.random.default_rng(3)
    for _ in range(4):
        goals = [tuple(generator.uniform(-1, 11, 2)) for _ in range(4)]
        every = plan_goals(problem, FAST, goals, every=True)
        quick = plan_goals(problem, FAST, goals)
        lengths = [FAST.solve(problem.between(problem.start, goal)).length for goal in goals]
        assert [answer.solution.length for answer in every] == lengths
        assert nearest(quick).length == nearest(every).length == min(lengths)
        for answer, length in zip(quick, lengths, strict=True):
            assert answer.least <= length
            if answer.solution is None:  # left out with reason
                assert min(lengths) <= answer.least
        assert nearest(quick).lower_bound == min(answer.least for answer in quick)


def test_a_far_goal_is_not_planned_to(problem):
    counted = Counted(FAST, [])
    answers = plan_goals(problem, counted, [(10, 10), (1, 1)])
    assert counted.asked == [((0.0, 0.0), (1.0, 1.0))]
    assert answers[0].solution is None
    assert answers[0].least == pytest.approx(tp.chord(problem.surface, (0, 0), (10, 10)))


def test_waypoints_before_several_goals_are_planned_to_once(problem):
    counted = Counted(FAST, [])
    answers = plan_goals(problem, counted, [(9, 2), (2, 9)], VIA, every=True)
    assert len(counted.asked) == len(set(counted.asked)) == 4
    for goal, answer in zip([(9, 2), (2, 9)], answers, strict=True):
        alone = plan_tour(problem.between(problem.start, goal), FAST, VIA)
        np.testing.assert_array_equal(alone.path.points, answer.solution.path.points)


def test_a_goal_that_cannot_be_reached_loses_and_its_bound_does_not_count():
    ground = walled()
    answers = plan_goals(ground, FAST, [(8, 8), (9.5, 2)], every=True)
    assert answers[0].solution.status is tp.Status.UNREACHABLE
    assert answers[0].least == np.inf
    best = nearest(answers)
    assert best.problem.goal == (9.5, 2.0)
    assert best.lower_bound == answers[1].least > 0.0
    assert nearest(plan_goals(ground, FAST, [(8, 8), (8.2, 8)])).status is tp.Status.UNREACHABLE


def test_a_goal_not_found_keeps_the_bound_of_its_chord(problem):
    poor = make_finished("rrt-star-r", samples=40, step=0.2, bound=True, informed=False)
    answers = plan_goals(problem, poor, [(10, 10), (0.1, 0.1)], every=True)
    assert answers[0].solution.status is tp.Status.NOT_FOUND
    assert answers[0].least == pytest.approx(tp.chord(problem.surface, (0, 0), (10, 10)))
    assert nearest(answers).problem.goal == (0.1, 0.1)


def test_an_interrupt_ends_the_search_for_the_nearest(problem):
    @dataclass(frozen=True)
    class Stopped(Counted):
        def solve(self, leg, *, callback=None):
            found = super().solve(leg, callback=callback)
            return replace(found, status=tp.Status.INTERRUPTED, stopped_by="interrupt")

    counted = Stopped(FAST, [])
    answers = plan_goals(problem, counted, [(9, 2), (2, 9.5)], every=True)
    assert len(counted.asked) == 1
    assert nearest(answers).status is tp.Status.INTERRUPTED
    assert nearest(answers).problem.goal == (9.0, 2.0)
