"""The verdicts on planners and fields, with answers that are right and faults that are planted."""

from types import SimpleNamespace

import numpy as np
import pytest
import shapely

import judges
import terrapath as tp
import verdicts

AXIS = np.linspace(0.0, 10.0, 21)
FLAT = judges.Ground(AXIS, AXIS, np.zeros((21, 21)))
ENDS = np.array([1.0, 2.0]), np.array([9.0, 7.0])


def scene_of(walls=(), *, exists=True, ground=FLAT):
    problem = SimpleNamespace(start=(1.0, 2.0), goal=(9.0, 7.0), bounds=(0.0, 0.0, 10.0, 10.0))
    return verdicts.Scene(problem, ground, list(walls), exists)


def solution_of(points, **more):
    points = np.array(points, float)
    told = {
        "path": SimpleNamespace(points=points),
        "status": tp.Status.SOLVED,
        "stopped_by": "",
        "length": judges.value_of(FLAT, points),
        "cost": judges.value_of(FLAT, points),
        "lower_bound": None,
    }
    return SimpleNamespace(**{**told, **more})


def faults_of(solution, scene=None, who="dijkstra"):
    trial = verdicts.Trial()
    verdicts.judge_solution(trial, scene or scene_of(), who, solution)
    return [fault.what for fault in trial.faults]


STRAIGHT = [(1, 2), (9, 7)]
NOTHING = {"path": None, "length": None, "status": tp.Status.NOT_FOUND}


def test_a_right_answer_has_no_fault():
    assert faults_of(solution_of(STRAIGHT)) == []
    assert faults_of(solution_of(STRAIGHT[::-1]), who="reversed") == []
    assert faults_of(solution_of(STRAIGHT, **NOTHING), scene_of(exists=False)) == []
    assert faults_of(solution_of(STRAIGHT, **NOTHING), who="rrt") == []


@pytest.mark.parametrize(
    ("found", "told", "points"),
    [
        ("value", {"length": 9.4}, STRAIGHT),
        ("cost", {"cost": 9.4}, STRAIGHT),
        ("ends", {}, [(1, 2), (9, 6.999)]),
        ("outside", {}, [(1, 2), (5, 10.001), (9, 7)]),
        ("touches", {}, STRAIGHT),
        ("not-found", NOTHING, STRAIGHT),
        ("unreachable", {**NOTHING, "status": tp.Status.UNREACHABLE}, STRAIGHT),
    ],
)
def test_a_planted_fault_is_found(found, told, points):
    walls = [shapely.box(4.0, 4.0, 5.0, 9.0)] if found == "touches" else []
    assert faults_of(solution_of(points, **told), scene_of(walls)) == [found]


def compared(optimal, back, *, others=(), **more):
    trial = verdicts.Trial()
    answers = {
        "optimal": verdicts.Answer(solution_of(STRAIGHT, **more), optimal),
        "reversed": verdicts.Answer(solution_of(STRAIGHT), back),
        "touching": verdicts.Answer(solution_of(STRAIGHT), 1.0, is_free=False),
    }
    verdicts.compare(trial, answers, dict(others))
    return [fault.what for fault in trial.faults]


def test_optimal_is_compared_with_all_others():
    assert compared(10.0, 10.0, others={"straight": 10.0}, lower_bound=10.0) == []
    assert compared(10.0, 10.0, others={"straight": 9.9999}) == ["beaten", "beaten"]
    assert compared(10.0, 10.0 + 1e-7) == ["reversal"]
    assert compared(10.0, 10.0, lower_bound=10.0001) == ["bound"]
    assert compared(10.1, 10.1, others={"straight": 10.0}, stopped_by="time limit") == [
        "beaten, cut short",
        "beaten",
    ]


def test_the_default_planner_is_not_beaten_by_the_straight_line():
    for value, found in ((10.0, []), (10.1, [("beaten", "rrt-star-r")])):
        trial = verdicts.Trial()
        answers = {"rrt-star-r": verdicts.Answer(solution_of(STRAIGHT), value)}
        verdicts.compare(trial, answers, {verdicts.STRAIGHT: 10.0})
        assert [fault[:2] for fault in trial.faults] == found


@pytest.mark.parametrize(
    ("value", "found"), [(10.0, []), (9.99, ["below-exact"]), (10.001, ["not-exact"])]
)
def test_optimal_on_a_grid_is_exact(value, found):
    trial = verdicts.Trial()
    verdicts.judge_exactness(trial, "optimal", verdicts.Answer(solution_of(STRAIGHT), value), 10.0)
    assert [fault.what for fault in trial.faults] == found


def field_of(factor, path=STRAIGHT):
    lattice = SimpleNamespace(points=np.stack(np.meshgrid(AXIS, AXIS), axis=-1))

    def at(points):
        return factor * np.hypot(*(np.asarray(points) - (1.0, 2.0)).T)

    values = at(lattice.points.reshape(-1, 2)).reshape(21, 21)
    made = SimpleNamespace(points=np.array(path, float)) if path else None
    return SimpleNamespace(lattice=lattice, values=values, at=at, path_to=lambda place: made)


@pytest.mark.parametrize(
    ("field", "found"),
    [
        (field_of(1.0), []),
        (field_of(0.998), ["field-below-chord"]),
        (field_of(-1.0), ["field-negative", "field-below-chord"]),
        (field_of(1.0, path=None), ["field-path"]),
    ],
)
def test_a_field_is_not_below_the_chord_and_has_paths(field, found):
    trial, scene = verdicts.Trial(), scene_of()
    verdicts.judge_values(trial, scene, field, "field")
    verdicts.judge_field_path(trial, scene, field, ENDS[1], "field")
    assert [fault.what for fault in trial.faults] == found


@pytest.mark.parametrize("error", [RuntimeError, MemoryError, tp.InputError])
def test_what_raises_is_a_fault(error):
    def call():
        raise error("why")

    trial = verdicts.Trial()
    assert trial.attempt("dijkstra", call) is None
    named = {RuntimeError: "crash", MemoryError: "memory", tp.InputError: "refused"}
    assert [fault.what for fault in trial.faults] == [named[error]]
    trial = verdicts.Trial(may_refuse=True)
    trial.attempt("dijkstra", call)
    assert len(trial.faults) == (error is not tp.InputError)
