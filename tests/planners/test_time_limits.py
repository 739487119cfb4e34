"""A call's own time limit, and planners that are loaded when they are first asked for."""

from dataclasses import dataclass

import pytest

import terrapath as tp
from common import made_up
from processes import in_another_process
from terrapath.planners import PLANNERS, Finished, make_planner, plan_tour
from terrapath.planners.base import PROVING, least_limit, options_of

NOTHING = 1e-9  # seconds
LONG = 3600.0
SLOW = {
    "rrt-star-r": {"samples": 500_000, "step": 3.0},
    "rrt-star": {"samples": 500_000, "step": 3.0},
    "rrt": {"samples": 500_000, "step": 0.001},
    "dijkstra": {"spacing": 0.02},
    "a-star": {"spacing": 0.02},
    "geodesic-traversal": {"directions": 10_000},
}


@pytest.fixture(scope="module")
def problem():
    return tp.scenes.load("one-peak")


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_keeps_the_time_limit_of_a_call(name, problem):
    seen = []
    make_planner(name, **SLOW.get(name, {})).solve(
        problem, callback=seen.append, time_limit=NOTHING
    )
    assert len([progress for progress in seen if progress.stage != PROVING]) == 1
    assert seen[0].samples < seen[0].total


@pytest.mark.parametrize("name", PLANNERS)
def test_of_two_time_limits_the_lower_counts(name, problem):
    seen = []
    planner = make_planner(name, time_limit=NOTHING, **SLOW.get(name, {}))
    planner.solve(problem, callback=seen.append, time_limit=LONG)
    assert len([progress for progress in seen if progress.stage != PROVING]) == 1
    assert least_limit(None, None) is None
    assert least_limit(2.0, None) == least_limit(None, 2.0) == least_limit(3.0, 2.0) == 2.0


@pytest.mark.parametrize("name", PLANNERS)
def test_a_time_limit_that_is_none_is_refused(name, problem):
    with pytest.raises(tp.InputError, match="time_limit=0"):
        make_planner(name).solve(problem, time_limit=0)


class Straight:
    """A planner that is no dataclass, and knows no time limit."""

    name = "straight"

    def solve(self, problem, *, callback=None):
        return made_up(problem, [problem.start, problem.goal], planner=self.name)


@pytest.mark.parametrize("planner", [Straight(), Finished(planner=Straight(), refine=True)])
def test_a_planner_of_ones_own_need_not_know_of_time_limits(planner, problem):
    answer = plan_tour(problem, planner, [(3.0, 8.0)])
    assert answer.status is tp.Status.SOLVED
    assert [leg.planner for leg in answer.legs] == ["straight", "straight"]


def test_finishing_hands_its_time_limit_to_the_planner(problem):
    limits = []

    @dataclass(frozen=True)
    class Noting(Straight):
        def solve(self, problem, *, callback=None, time_limit=None):
            limits.append(time_limit)
            return super().solve(problem)

    finished = Finished(planner=Noting(), time_limit=30.0)
    finished.solve(problem)
    finished.solve(problem, time_limit=5.0)
    finished.solve(problem, search_limit=3.0)
    assert limits == [30.0, 5.0, 3.0]


def test_the_options_of_a_planner_are_its_fields():
    options = options_of(tp.AStar(spacing=0.5))
    assert options == {"spacing": 0.5, "neighbours": 16, "time_limit": None}
    assert options_of(Straight()) == {}


NAMES = """
import json, sys
from terrapath.planners import PLANNERS, make_planner
def loaded():
    return sorted(m for m in sys.modules if m.startswith("terrapath.") and "_kernels" not in m)
names, before = list(PLANNERS), loaded()
make_planner("rrt")
print(json.dumps([names, before, loaded()]))
"""


def test_names_are_known_before_any_planner_is_loaded():
    names, before, after = in_another_process(NAMES)
    assert names == list(PLANNERS)
    assert "terrapath.planners.registry" in before
    assert "terrapath.planners.rrt" not in before
    assert "terrapath.problem" not in before
    assert "terrapath.planners.rrt" in after
    others = {"grid_search", "fast_marching", "geodesic_traversal", "optimal"}
    assert not {f"terrapath.planners.{name}" for name in others} & set(after)


def test_the_registry_is_a_mapping_to_what_makes_planners():
    assert len(PLANNERS) == len(list(PLANNERS)) == len({*PLANNERS})
    for name in PLANNERS:
        assert PLANNERS[name]().name == name
    assert "rtt" not in PLANNERS
    with pytest.raises(KeyError):
        PLANNERS["rtt"]
