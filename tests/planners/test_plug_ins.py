"""Planners that other packages announce by an entry point."""

import pytest

import terrapath as tp
from packages import installed_package
from terrapath.cli.main import run
from terrapath.planners import PLANNERS

MODULE = '''
import dataclasses
import terrapath as tp

@dataclasses.dataclass(frozen=True)
class Straight:
    """The straight line."""
    bend: float = 0.0
    name = "straight"

    def solve(self, problem, *, callback=None):
        (x0, y0), (x1, y1) = problem.start, problem.goal
        middle = (x0 + x1) / 2, (y0 + y1) / 2 + self.bend
        path = problem.path([problem.start, middle, problem.goal])
        return tp.Solution(problem=problem, planner=self.name, status=tp.Status.SOLVED, path=path,
                           cost=path.length, seconds=0.0)

def no_planner():
    pass
'''
ENTRIES = """[terrapath.planners]
straight = straight_planner:Straight
odd = straight_planner:no_planner
lost = no_such_package_at_all:Planner
rrt = straight_planner:Straight
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A package that announces planners."""
    with installed_package(tmp_path, monkeypatch, "straight_planner", MODULE, ENTRIES):
        yield


def test_a_plug_in_is_planned_with_by_its_name_and_options(installed):
    problem = tp.scenes.load("one-peak")
    straight = tp.plan(problem, "straight")
    assert straight.planner == "straight"
    assert tp.plan(problem, "straight", bend=2.0).length != straight.length
    assert tp.plan(problem, "straight", refine=True, bound=True).gap is not None
    assert {"straight", "optimal"} <= set(PLANNERS)


def test_the_command_knows_it_too(installed, capsys):
    assert run(["plan", "one-peak", "--planner", "straight", "--no-bound", "--no-refine"]) == 0
    assert "straight" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "shown"),
    [("odd", "is no planner"), ("lost", "cannot be loaded"), ("strait", "straight")],
)
def test_what_cannot_be_used_is_one_line(installed, name, shown):
    with pytest.raises(tp.InputError, match=shown) as caught:
        tp.plan(tp.scenes.load("one-peak"), name)
    assert "\n" not in str(caught.value)


def test_an_unknown_option_of_it_is_named(installed):
    with pytest.raises(tp.InputError, match="did you mean bend"):
        tp.plan(tp.scenes.load("one-peak"), "straight", bent=1.0)


def test_no_plug_in_takes_the_name_of_a_planner_of_ours(installed):
    assert type(PLANNERS["rrt"]()).__module__ == "terrapath.planners.rrt"
