"""Refinement and bound for any planner's answer, and what stops them."""

import dataclasses
import math

import numpy as np
import pytest
import shapely

import terrapath as tp
from terrapath.errors import UnfinishedWarning
from terrapath.planners import (
    PLANNERS,
    Finished,
    candidates,
    finish,
    finished,
    make_finished,
)
from terrapath.planners.base import PROVING, REFINING, SEARCHING

TRUTH = tp.scenes.SCENES["one-peak"].true_length
COARSE = {"dijkstra": {"spacing": 0.4}, "a-star": {"spacing": 0.4}, "optimal": {"target_gap": 0.1}}


@pytest.fixture(scope="module")
def problem():
    return tp.scenes.load("one-peak")


@pytest.fixture(scope="module")
def raw(problem):
    return tp.plan(problem, samples=300)


@pytest.fixture
def enclosed(problem):
    moat = shapely.Point(10, 10).buffer(0.6).exterior
    return tp.Problem(problem.surface, (0, 0), (10, 10), problem.bounds, [moat])


def interrupt(*_, **__):
    raise KeyboardInterrupt


def fail(*_, **__):
    raise ArithmeticError("by zero")


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_ends_at_the_same_length(name, problem):
    solution = tp.plan(problem, name, refine=True, bound=True, **COARSE.get(name, {}))
    assert solution.length == pytest.approx(TRUTH, rel=1e-7)
    assert solution.unrefined.length >= solution.length
    assert solution.lower_bound <= TRUTH
    assert solution.certificate.check(problem) == solution.lower_bound
    assert solution.gap < 0.01


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_says_what_is_proven_unreachable(name, enclosed):
    solution = tp.plan(enclosed, name, refine=True, bound=True)
    assert solution.status is tp.Status.UNREACHABLE
    assert solution.stopped_by.startswith(
        "start and goal lie in different parts of the free space: obstacles lie"
    )
    assert solution.path is solution.lower_bound is solution.certificate is None


def test_finishing_adds_to_a_solution_and_changes_nothing_else(raw):
    refined = finish(raw, refine=True)
    assert refined.unrefined is raw.path
    assert refined.certificate is None
    assert (refined.cost, refined.tree, refined.seed) == (raw.cost, raw.tree, raw.seed)
    assert refined.seconds > raw.seconds
    bounded = finish(raw, bound=True)
    assert bounded.path is raw.path
    assert bounded.unrefined is None
    assert finish(raw) is raw


def test_what_is_done_is_not_done_again(raw, monkeypatch):
    done = finish(raw, refine=True, bound=True)
    monkeypatch.setattr(finished, "refine", None)
    monkeypatch.setattr(finished, "lower_bound", None)
    assert finish(done, refine=True, bound=True, target_gap=done.gap) is done


def test_a_target_gap_is_worked_on_after_a_bound_that_misses_it(raw):
    coarse = finish(raw, refine=True, bound=True)
    fine = finish(coarse, target_gap=0.6 * coarse.gap)
    assert fine.gap <= 0.6 * coarse.gap
    assert fine.lower_bound > coarse.lower_bound


def test_where_the_start_is_the_goal_the_bound_is_zero(problem):
    stay = tp.Problem(problem.surface, (2, 5), (2, 5), problem.bounds)
    solution = tp.plan(stay, refine=True, bound=True)
    assert solution.length == solution.lower_bound == solution.gap == 0.0


def test_a_callback_sees_every_stage(problem):
    seen = []
    solution = tp.plan(problem, samples=600, refine=True, target_gap=4e-4, callback=seen.append)
    stages = [progress.stage for progress in seen]
    assert stages == sorted(stages, key=[SEARCHING, REFINING, PROVING].index)
    assert set(stages) == {SEARCHING, REFINING, PROVING}
    assert all(math.isinf(p.gap) for p in seen if p.stage != PROVING)
    gaps = [p.gap for p in seen if p.stage == PROVING]
    assert gaps[0] == math.inf
    assert gaps == sorted(gaps, reverse=True)
    assert solution.gap <= gaps[-1]
    assert [p.seconds for p in seen] == sorted(p.seconds for p in seen)


def test_a_callback_ends_the_refinement_of_the_bound(problem):
    solution = tp.plan(problem, samples=600, target_gap=1e-9, callback=lambda p: p.gap < 1.0)
    assert solution.status is tp.Status.SOLVED
    assert solution.stopped_by == "samples"
    assert 1e-9 < solution.gap < 0.15


def test_a_time_limit_holds_for_the_bound_too(problem):
    solution = tp.plan(problem, samples=600, target_gap=1e-9, time_limit=1e-3)
    assert solution.path is not None
    chord = float(tp.chord(problem.surface, problem.start, problem.goal))
    assert chord * (1.0 - 1e-8) <= solution.lower_bound <= TRUTH  # at least the chord
    assert solution.certificate.lattice.nx <= 122


@pytest.mark.parametrize("stage", ["refine", "lower_bound"])
def test_ctrl_c_keeps_what_was_there(stage, raw, monkeypatch):
    monkeypatch.setattr(finished, stage, interrupt)
    solution = finish(raw, refine=True, bound=True)
    assert solution.status is tp.Status.INTERRUPTED
    assert solution.stopped_by == "interrupt"
    assert solution.lower_bound is None
    assert (solution.path is raw.path) == (stage == "refine")


def test_ctrl_c_keeps_the_bound_so_far(raw, monkeypatch):
    known = finish(raw, bound=True).certificate

    def interrupted(_, watch, **__):
        watch(known)
        raise KeyboardInterrupt

    monkeypatch.setattr(finished, "lower_bound", interrupted)
    solution = finish(raw, target_gap=1e-9)
    assert solution.status is tp.Status.INTERRUPTED
    assert solution.certificate is known
    assert solution.lower_bound == known.value
    assert solution.path is raw.path


def test_an_interrupted_answer_is_left_as_it_is(raw, monkeypatch):
    monkeypatch.setattr(finished, "refine", None)
    monkeypatch.setattr(finished, "lower_bound", None)
    stopped = dataclasses.replace(raw, status=tp.Status.INTERRUPTED)
    assert finish(stopped, refine=True, bound=True) is stopped


@pytest.mark.parametrize("stage", ["refine", "lower_bound"])
def test_a_failure_keeps_what_was_there_and_warns(stage, raw, monkeypatch):
    monkeypatch.setattr(finished, stage, fail)
    with pytest.warns(UnfinishedWarning, match="ArithmeticError: by zero"):
        solution = finish(raw, refine=True, bound=True)
    assert solution.status is tp.Status.SOLVED
    assert (solution.path is raw.path) == (stage == "refine")
    assert (solution.lower_bound is None) == (stage == "lower_bound")


@pytest.mark.parametrize(
    "options", [{"target_gap": 0.0}, {"target_gap": -1.0}, {"target_gap": np.nan}, {"refine": 1}]
)
def test_bad_options_are_refused(options, problem, raw):
    with pytest.raises(tp.InputError, match=next(iter(options))):
        tp.plan(problem, **options)
    if "target_gap" in options:
        with pytest.raises(tp.InputError, match="target_gap"):
            finish(raw, **options)


def test_a_planner_with_a_target_gap_of_its_own_is_given_it():
    made = make_finished("optimal", target_gap=0.02)
    assert made.planner == tp.Optimal(target_gap=0.02)
    assert made.target_gap is None
    made = make_finished("rrt", target_gap=0.02, time_limit=3.0)
    assert made == Finished(planner=tp.RRT(time_limit=3.0), target_gap=0.02, time_limit=3.0)
    assert made.name == "rrt"


@pytest.mark.parametrize(("asked", "gap"), [({"target_gap": 0.05}, 0.05), ({}, 0.001)])
def test_the_options_tell_the_target_gap_that_optimal_worked_on(asked, gap, problem):
    stay = tp.Problem(problem.surface, (2, 5), (2, 5), problem.bounds)
    options = tp.plan(stay, "optimal", **asked).options
    assert options == {"routes": 3, "target_gap": gap, "refine": False, "bound": False}


def test_the_options_tell_the_target_gap_of_the_finishing(problem):
    stay = tp.Problem(problem.surface, (2, 5), (2, 5), problem.bounds)
    assert tp.plan(stay, "rrt", target_gap=0.05).options["target_gap"] == 0.05
    assert "target_gap" not in tp.plan(stay, "rrt").options


# Optimal: as the tree planners, it keeps the best so far and says what ended it


def test_optimal_says_when_the_finest_lattice_was_not_enough(problem, monkeypatch):
    monkeypatch.setattr("terrapath.certificates.search.SIDES", (40, 60))
    solution = tp.Optimal(target_gap=1e-9).solve(problem)
    assert solution.stopped_by == "finest lattice"
    assert solution.status is tp.Status.SOLVED
    assert 1e-9 < solution.gap < 0.05


@pytest.mark.parametrize("stage", ["march_both", "routes_of_fields"])
def test_ctrl_c_while_optimal_looks_for_routes(stage, problem, monkeypatch):
    monkeypatch.setattr(candidates, stage, interrupt)
    solution = tp.Optimal().solve(problem)
    assert solution.status is tp.Status.INTERRUPTED
    assert solution.stopped_by == "interrupt"
    assert solution.lower_bound is None
    # What is there is the straight line, or the path down the field, not refined.
    unrefined = problem.straight_length if stage == "march_both" else TRUTH
    assert solution.length == pytest.approx(unrefined, rel=1e-2)


def test_ctrl_c_while_optimal_proves_keeps_the_routes(problem, monkeypatch):
    monkeypatch.setattr(finished, "lower_bound", interrupt)
    solution = tp.Optimal().solve(problem)
    assert solution.status is tp.Status.INTERRUPTED
    assert solution.stopped_by == "interrupt"
    assert solution.length == pytest.approx(TRUTH, rel=1e-7)
    assert solution.lower_bound is None


def test_optimal_keeps_fast_marchings_path_where_no_route_can_be_refined(problem, monkeypatch):
    monkeypatch.setattr(candidates, "routes_of_fields", fail)
    with pytest.warns(UnfinishedWarning, match="ArithmeticError: by zero"):
        solution = tp.Optimal(target_gap=0.1).solve(problem)
    assert solution.length == pytest.approx(TRUTH, rel=1e-2)  # unrefined
    assert solution.gap <= 0.1


def test_a_callback_sees_what_optimal_does(problem):
    seen = []
    tp.Optimal(target_gap=4e-4).solve(problem, callback=seen.append)
    searching = [p for p in seen if p.stage == "trying distance fields"]
    assert searching
    assert all(0 < p.samples <= p.total for p in searching)
    assert [p.stage for p in seen][-1] == PROVING
    assert seen[-1].best_cost == pytest.approx(TRUTH, rel=1e-7)


def test_ends_so_close_that_nothing_is_proven_have_an_infinite_gap():
    surface = tp.Surface.from_peaks([[(5.0, 0.1, 5.0, 5.0)]])
    problem = tp.Problem(surface, (0.1 + 0.2, 0.0), (0.3, 0.0), bounds=(-1.0, -1.0, 11.0, 11.0))
    for planner in ("optimal", "a-star"):
        solution = tp.plan(problem, planner, bound=planner != "optimal")
        assert solution.status is tp.Status.SOLVED
        assert (solution.lower_bound, solution.gap) == (0.0, math.inf)


def test_a_bound_above_the_path_is_not_taken(raw):
    bound = tp.lower_bound(raw.problem)
    wrong = dataclasses.replace(bound, value=1.01 * raw.length)
    with pytest.warns(UnfinishedWarning, match="contradicts"):
        assert finished.with_certificate(raw, wrong).lower_bound is None
