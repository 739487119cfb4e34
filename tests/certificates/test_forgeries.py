"""Certificates that were altered, or are of another problem, are rejected."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

import terrapath as tp
from certificate_cases import BOUNDS, SIDE, certified, hills, nudged, resealed
from terrapath.certificates import certificate, claims
from terrapath.certificates.certificate import fingerprint, seal_of
from terrapath.certificates.claims import Core
from terrapath.surface.bounds import Bounds

NUDGES = {
    "value up": lambda made: {"value": made.value * (1.0 + 1e-6)},
    "value up a little": lambda made: {"value": math.nextafter(made.value, math.inf)},
    "value down": lambda made: {"value": made.value * (1.0 - 1e-6)},
    "norm up": lambda made: {"norm": made.norm * (1.0 + 1e-6)},
    "norm down": lambda made: {"norm": made.norm * (1.0 - 1e-6)},
    "horizon up": lambda made: {"horizon": made.horizon * (1.0 + 1e-6)},
    "horizon down": lambda made: {"horizon": made.horizon * (1.0 - 1e-6)},
    "first coefficient": lambda made: {"coefficients": nudged(made, 0, 0, 1e-9)},
    "last coefficient": lambda made: {"coefficients": nudged(made, -1, -1, 1e-9)},
    "start core": lambda made: {"start_core": made.start_core._replace(row0=0)},
    "goal core": lambda made: {
        "goal_core": made.goal_core._replace(column0=made.goal_core.column0 - 1)
    },
    "bounds": lambda made: {"bounds": made.bounds._replace(x1_min=made.bounds.x1_min + 1e-9)},
    "seal": lambda made: {"seal": made.seal[::-1]},
    "no seal": lambda made: {"seal": ""},
}


@pytest.mark.parametrize("name", NUDGES)
def test_any_altered_number_is_told_by_the_seal(honest, name):
    problem, made = honest
    with pytest.raises(tp.CertificateError, match="altered after it was made"):
        replace(made, **NUDGES[name](made)).check(problem)


def test_every_coefficient_is_under_the_seal(honest):
    problem, made = honest
    random = np.random.default_rng(0)
    rows, columns = made.coefficients.shape
    for row, column in zip(
        random.integers(0, rows, 60), random.integers(0, columns, 60), strict=True
    ):
        up = nudged(made, row, column, abs(made.coefficients[row, column]) * 1e-15 + 1e-15)
        with pytest.raises(tp.CertificateError, match="altered"):
            replace(made, coefficients=up).check(problem)


def next_to_flat(made):
    """A function whose slopes' squares are no numbers above 0."""
    return {"coefficients": 1e-170 * made.coefficients, "horizon": 1e-100, "norm": 1e-200}


TIGHT = {
    "next to flat": next_to_flat,
    "value up": lambda made: {"value": made.value * (1.0 + 1e-6)},
    "value up by a little": lambda made: {"value": made.value * (1.0 + 1e-10)},
    "norm down": lambda made: {"norm": made.norm * (1.0 - 1e-4)},
    "norm far down": lambda made: {"norm": 0.5 * made.norm},
    "norm down, value up": lambda made: {
        "norm": made.norm * (1.0 - 1e-4),
        "value": made.value * (1.0 + 1e-4),
    },
    "steeper as a whole": lambda made: {
        "coefficients": made.coefficients * 1.001,
        "horizon": made.horizon * 1.001,
    },
    "a step": lambda made: {
        "coefficients": made.coefficients + 0.1 * (made.coefficients > 8.0),
    },
    "another window": lambda made: {
        "bounds": made.bounds._replace(x1_max=made.bounds.x1_max - 0.5)
    },
    "a start core over the hill": lambda made: {
        "start_core": Core(0, made.lattice.nx // 2, 0, made.lattice.ny // 2)
    },
    "a goal core over the hill": lambda made: {
        "goal_core": Core(
            made.lattice.nx // 2, made.lattice.nx - 1, made.lattice.ny // 2, made.lattice.ny - 1
        )
    },
    "cores that meet": lambda made: {
        "goal_core": made.start_core._replace(column1=made.lattice.nx - 1, row1=made.lattice.ny - 1)
    },
    "coefficients of a smaller lattice": lambda made: {
        "coefficients": np.ascontiguousarray(made.coefficients[:-1, :-1])
    },
}


@pytest.mark.parametrize("name", TIGHT)
def test_a_sealed_forgery_is_rejected_by_the_mathematics(honest, name):
    problem, made = honest
    with pytest.raises(tp.CertificateError, match=r"can be proven|does not hold|norm at least"):
        resealed(made, **TIGHT[name](made)).check(problem)


def sealed(problem, **claim):
    """A certificate of somebody who knows how it is checked."""
    made = certificate.Certificate(fingerprint=fingerprint(problem), **claim)
    return replace(made, seal=seal_of(made))


def test_what_counts_for_nothing_on_a_cores_edge_does_so_however_large():
    # The coefficients of one column are seen from nowhere but the core's own edge, where their
    # weight is 0, or was the cube of a rounding error.
    surface = tp.Surface.from_peaks([[(1.0, 0.1, 5.0, 20.0)]])
    problem = tp.Problem(surface, (0.0, 0.0), (10.0, 0.0), bounds=(-1.7, -128.0, 13.1, 128.0))
    columns, rows = 34, 256
    width = problem.bounds.width / columns
    for column in range(6, 16):
        at = problem.bounds.x1_min + column * width
        error = 1.0 - ((at - problem.bounds.x1_min) / width - (column - 1))
        if error != 0.0:
            break
    assert 0.0 < abs(error) < 1e-14
    forged = np.zeros((rows + 3, columns + 3))
    forged += np.interp(np.arange(columns + 3), [3, column - 1], [-384.0, 0.0])
    height = np.maximum(124.0 - np.abs(np.arange(rows + 3) - 129.0), 0.0)
    height[:3] = height[-3:] = 0.0
    forged[:, column - 1] -= 6.0 * height / error**3
    forgery = sealed(
        problem,
        value=122.0,
        norm=1.0,
        coefficients=forged,
        bounds=problem.bounds,
        horizon=1000.0,
        start_core=Core(0, column, 0, rows),
        goal_core=Core(columns - 12, columns - 2, rows // 2 - 2, rows // 2 + 2),
    )
    with pytest.raises(tp.CertificateError, match="can be proven"):
        forgery.check(problem)


def test_a_chord_that_overflows_proves_nothing():
    cell = 5e153  # its square is a number, that of the chord from the step on is not
    problem = tp.Problem(
        tp.Surface.from_peaks([[]]),
        (0.0, 0.0),
        (40.0 * cell, 0.0),
        (-5.0 * cell, -5.0 * cell, 45.0 * cell, 5.0 * cell),
    )
    step = np.where(np.arange(53) < 20, 0.0, 1e200)
    forgery = sealed(
        problem,
        value=1e199,
        norm=1.0,
        coefficients=np.repeat(step[None], 13, axis=0),
        bounds=problem.bounds,
        horizon=1e200,
        start_core=Core(4, 6, 4, 6),
        goal_core=Core(44, 46, 4, 6),
    )
    with pytest.raises(tp.CertificateError, match="can be proven"):
        forgery.check(problem)


def test_rounded_layers_count_as_much_as_the_ground_around_costs():
    # Heights so large that a chord is rounding, on dear ground, and cheap ground far off.
    axis, length = np.arange(40.0), 1e-3
    cost = np.ones((40, 40))
    cost[36:, 36:] = 1e-9
    ground = np.full((40, 40), 1e12)
    surface = tp.Surface.from_grid(
        np.stack([ground, cost]), axis, axis, kinds=["rise", "cost"], names=["h", "c"]
    )
    nodes, centre = 60, 30
    for k in range(12):
        start = (5.31 + 0.37 * k, 5.73 + 0.11 * k)
        goal = (start[0] + length, start[1])
        corner = (start[0] - 0.25 * length, start[1] - 0.5 * length)
        bounds = (*corner, corner[0] + 1.5 * length, corner[1] + length)
        problem = tp.Problem(surface, start, goal, bounds)
        east = (np.arange(nodes + 3) - 1.0) * problem.bounds.width / nodes - 0.25 * length
        forgery = sealed(
            problem,
            value=0.0,
            norm=1.0 + 1e-8,
            coefficients=np.repeat(east[None], nodes + 3, axis=0),
            bounds=problem.bounds,
            horizon=10.0 * length,
            start_core=Core(8, 12, centre - 2, centre + 2),
            goal_core=Core(48, 52, centre - 2, centre + 2),
        )
        proven = claims.proven_value(problem, forgery, forgery.norm)
        assert proven <= problem.path([start, goal]).length


def test_a_goal_on_the_maps_edge_is_not_rounded_off_it():
    start, goal = (-0.1, 0.0), (0.2, 0.0)
    assert start[0] + (goal[0] - start[0]) > goal[0]
    x, y = np.linspace(-12.0, goal[0], 30), np.linspace(-5.0, 5.0, 25)
    cost = np.ones((25, 30)) + 0.1 * np.sin(x)
    surface = tp.Surface.from_grid(
        np.stack([np.zeros((25, 30)), cost]), x, y, kinds=["rise", "cost"], names=["h", "c"]
    )
    problem = tp.Problem(surface, start, goal)
    assert problem.bounds.x1_max == goal[0]
    assert tp.lower_bound(problem, length=40.0).check(problem) > 0.0


def test_an_honest_certificate_may_claim_less(honest):
    problem, made = honest
    assert resealed(made, value=0.99 * made.value).check(problem) == 0.99 * made.value
    assert resealed(made, norm=made.norm * 1.001, value=0.9 * made.value).check(problem)


def test_a_coefficient_nudged_up_where_the_norm_is_tight_is_rejected(honest):
    problem, made = honest
    path = tp.refine(problem, tp.FastMarching().solve(problem).path)
    lattice = made.lattice
    shares = np.linspace(0.15, 0.85, 12)
    places = [path.line.interpolate(share, normalized=True).coords[0] for share in shares]
    for x, y in places:
        column = round((x - made.bounds.x1_min) / lattice.dx) + 1
        row = round((y - made.bounds.x2_min) / lattice.dy) + 1
        for share in (0.02, 0.05):
            forged = resealed(made, coefficients=nudged(made, row, column, share * lattice.dx))
            with pytest.raises(tp.CertificateError, match="the dual norm is claimed"):
                forged.check(problem)


def test_what_lies_beyond_the_horizon_does_not_matter_until_the_horizon_is_raised(honest):
    problem, made = honest
    wild = made.coefficients.copy()
    # The corner opposite the goal, as seen from the start, is out of reach.
    beyond = wild > made.horizon
    assert beyond.sum() > 10
    random = np.random.default_rng(0)
    wild[beyond] += random.uniform(0.0, 3.0, beyond.sum())
    forged = resealed(made, coefficients=wild)
    assert forged.check(problem) == made.value
    with pytest.raises(tp.CertificateError, match="the dual norm is claimed"):
        resealed(forged, horizon=made.horizon + 2.0).check(problem)


def test_a_lower_horizon_needs_less_of_every_cell_and_proves_less():
    problem = hills()
    made = certified(problem, 40, 17.0)
    low = resealed(made, horizon=made.horizon - 1.0)
    before, after = (claims.cell_needs(problem, c, 0.0).proven for c in (made, low))
    assert (after <= before * (1.0 + 1e-12)).all()
    assert (after < before).any()
    assert claims.proven_value(problem, low, low.norm) < made.value - 0.5
    with pytest.raises(tp.CertificateError, match="no more than"):
        resealed(low, value=made.value).check(problem)


def obstructed(obstacles, *, goal=(9.0, 5.0), start=(1.0, 5.0), weight=1.0, amplitude=1.0, x=5.0):
    surface = tp.Surface.from_peaks([[(amplitude, 0.5, x, 3.0)]], weights=[weight])
    return tp.Problem(surface, start, goal, BOUNDS, obstacles)


OTHERS = {
    "goal": {"goal": (8.9, 5.0)},
    "start": {"start": (1.1, 5.0)},
    "weight": {"weight": 0.5},
    "amplitude": {"amplitude": 0.5},
    "no obstacle": {"obstacles": []},
    "a smaller obstacle": {"obstacles": [shapely.box(4.0, 1.0, 6.0, 7.5)]},
    "a hole": {"obstacles": [shapely.box(4.0, 1.0, 6.0, 8.0) - shapely.box(3.0, 4.8, 7.0, 5.2)]},
}


@pytest.mark.parametrize("name", OTHERS)
def test_a_certificate_of_another_problem_is_rejected(name):
    wall = [shapely.box(4.0, 1.0, 6.0, 8.0)]
    problem = obstructed(wall)
    made = certified(problem, 60)
    assert made.check(problem) == made.value
    other = obstructed(**{"obstacles": wall, **OTHERS[name]})
    with pytest.raises(tp.CertificateError, match="differ"):
        made.check(other)
    # With the fingerprint forged as well, the shorter way there refutes it.
    forged = resealed(made, fingerprint=certificate.fingerprint(other))
    if name not in ("weight", "amplitude"):
        with pytest.raises(tp.CertificateError, match=r"can be proven|does not hold|norm at least"):
            forged.check(other)


def test_fingerprints_tell_all_that_matters_apart():
    axis = np.linspace(0.0, SIDE, 6)
    random = np.random.default_rng(0)
    values = random.normal(size=(6, 6))
    mask = np.zeros((5, 5), bool)
    centres = np.arange(5) * 2.0 + 1.0
    marked = mask.copy()
    marked[2, 4] = True

    def problem(values=values, x=axis, y=axis, ends=((1, 1), (9, 9)), bounds=None, **options):
        surface = tp.Surface.from_grid(values, x, y, weights=options.get("weights"))
        return tp.Problem(surface, *ends, bounds, options.get("obstacles", ()))

    several = [
        problem(),
        problem(values=values.T.copy()),
        problem(weights=[0.5]),
        problem(ends=((1, 1), (9, 8))),
        problem(ends=((9, 9), (1, 1))),
        problem(bounds=(0, 0, 10, 9.5)),
        problem(x=axis + 0.01, bounds=(0.01, 0, 10, 10)),
        problem(obstacles=[shapely.box(3, 3, 4, 4)]),
        problem(obstacles=[tp.Circle(3.0, 3.0, 1.0)]),
        problem(obstacles=[tp.Mask(mask, centres, centres)]),
        problem(obstacles=[tp.Mask(marked, centres, centres)]),
        tp.Problem(tp.Surface.from_peaks([[(1, 1, 1, 1)]]), (1, 1), (9, 9), BOUNDS),
        tp.Problem(tp.Surface.from_peaks([[(1, 1, 1, 1)], []]), (1, 1), (9, 9), BOUNDS),
        tp.Problem(tp.Surface.from_peaks([[], [(1, 1, 1, 1)]]), (1, 1), (9, 9), BOUNDS),
    ]
    prints = {certificate.fingerprint(p) for p in several}
    assert len(prints) == len(several)
    assert certificate.fingerprint(problem()) in prints


def test_samples_of_another_shape_have_another_fingerprint():
    # 4 x 6 and 6 x 4 coefficients, the same numbers: another surface.
    values = np.zeros((4, 6))
    across = tp.Surface.from_grid(values, np.arange(6.0), np.arange(4.0))
    along = tp.Surface.from_grid(values.T, np.arange(4.0), np.arange(6.0))
    problems = [tp.Problem(s, (1, 1), (2, 2), (0, 0, 3, 3)) for s in (across, along)]
    assert len({certificate.fingerprint(p) for p in problems}) == 2


SENSELESS = {
    "norm nan": {"norm": math.nan},
    "norm inf": {"norm": math.inf},
    "norm 0": {"norm": 0.0},
    "norm below 0": {"norm": -1.0},
    "value nan": {"value": math.nan},
    "value inf": {"value": math.inf},
    "horizon nan": {"horizon": math.nan},
    "horizon inf": {"horizon": math.inf},
    "no coefficients": {"coefficients": np.zeros((0, 0))},
    "too few": {"coefficients": np.zeros((3, 3))},
    "one axis": {"coefficients": np.zeros(100)},
    "nan": {"coefficients": np.full((12, 12), math.nan)},
    "inf": {"coefficients": np.full((12, 12), math.inf)},
    "float32": {"coefficients": np.zeros((12, 12), np.float32)},
    "bounds beyond": {"bounds": Bounds(-2.0, -1.0, 11.0, 11.0)},
    "bounds nan": {"bounds": Bounds(math.nan, -1.0, 11.0, 11.0)},
    "bounds turned": {"bounds": Bounds(11.0, 11.0, -1.0, -1.0)},
    "bounds empty": {"bounds": Bounds(-1.0, -1.0, -1.0, 11.0)},
    "core of halves": {"start_core": Core(0.5, 20.5, 0.5, 20.5)},
    "core below 0": {"start_core": Core(-1, 9, 0, 9)},
    "core too far": {"goal_core": Core(80, 10_000, 80, 10_000)},
    "core empty": {"goal_core": Core(90, 90, 90, 90)},
    "core elsewhere": {"start_core": Core(50, 60, 50, 60)},
}


@pytest.mark.parametrize("name", SENSELESS)
def test_a_certificate_without_sense_is_rejected_in_one_line(honest, name):
    problem, made = honest
    with pytest.raises(tp.CertificateError) as caught:
        resealed(made, **SENSELESS[name]).check(problem)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("seed", range(6))
def test_a_random_function_proves_only_what_is_true(seed):
    # Whatever u is: the proof is what counts.
    random = np.random.default_rng([5, seed])
    problem = obstructed([shapely.box(4.0, 1.0, 6.0, 8.0)])
    made = certified(problem, 30)
    truth = tp.refine(problem, tp.FastMarching().solve(problem).path).length
    values = []
    for size in (1e-3, 1e-2, 0.1, 1.0):
        rough = made.coefficients + size * random.normal(size=made.coefficients.shape)
        proposal = replace(made, coefficients=rough)
        needs = claims.cell_needs(problem, proposal, 0.0)
        found = certificate.certify(problem, proposal, needs)
        assert found.check(problem) == found.value <= truth
        values.append(found.value)
    assert values[0] > values[2]
