"""Bounds on rough ground: near, above no path, proven again from the problem and the file alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

import certificate_oracles as oracles
import terrapath as tp
from certificate_cases import ROUNDING, resealed
from common import mostly_slow
from processes import in_another_process
from rough_maps import fractal, random_map
from terrapath._kernels.certificates import spline_flow as kernels
from terrapath.certificates import claims, spline_levels
from terrapath.certificates.search import has_many_knots, lower_bound, search_window
from terrapath.space.lattice import Lattice


def never():
    return False


def heights(side, height, seed):
    return height * fractal(np.random.default_rng(seed), side, side, 2.2)


def rough(side=90, height=3.0, seed=1, **options):
    """A fractal map from corner to corner."""
    axis = np.arange(float(side))
    surface = tp.Surface.from_grid(heights(side, height, seed), axis, axis)
    return tp.Problem(surface, (3.0, 4.0), (side - 5.0, side - 4.5), **options)


def potential(problem, length=math.inf, gap=1e-2):
    """The first certificate of the best potential."""
    window = search_window(problem, length)
    return next(spline_levels.spline_certificates(problem, window, gap, 10**6, never, never))


def path_of(problem):
    return tp.plan(problem, "a-star", neighbours=32, refine=True).path


def search_on(problem, lattice):
    return spline_levels._search(problem, lattice, 1, None)


# Near


@pytest.mark.parametrize("height", [3.0, 12.0])
def test_the_best_potential_is_far_nearer_than_a_field(height):
    problem = rough(height=height)
    assert has_many_knots(problem, problem.bounds)
    length = tp.plan(problem, "fast-marching", refine=True).length
    seen = []
    lower_bound(
        problem, length=length, target_gap=1e-6, watch=lambda c: seen.append(c) or len(seen) > 1
    )
    field, best = (length / float(c) - 1.0 for c in seen)
    assert -ROUNDING < best < 0.5 * field
    assert best < (0.01 if height == 3.0 else 0.05)


def test_on_steep_ground_a_norm_is_asked_for_that_projections_can_reach():
    # When 1.0004 was asked for, projections undid one another, and 1.019 was left.
    assert potential(rough(height=20.0), gap=1e-3).norm < 1.016


def test_smooth_ground_keeps_to_fields():
    for problem in (tp.scenes.load("six-peaks"), rough(side=40)):
        assert not has_many_knots(problem, problem.bounds)


def test_finer_lattices_prove_more():
    problem = rough(side=70, seed=2)
    found = spline_levels.spline_certificates(problem, problem.bounds, 1e-3, 10**5, never, never)
    first, second = (float(next(found)) for _ in range(2))
    assert first < second


# True


@pytest.mark.parametrize("seed", mostly_slow(range(24), quick=4))
def test_no_bound_is_above_a_path_among_obstacles_and_costs(seed):
    problem = random_map(seed).problem()
    path = path_of(problem)
    if path is None:
        pytest.skip("no path leads there")
    for length in (path.length, math.inf):
        made = potential(problem, length)
        assert made.value <= path.length * (1.0 + ROUNDING)
        straight = float(tp.chord(problem.surface, problem.start, problem.goal))
        assert made.value >= straight * (problem.surface.least_cost * (1.0 - 1e-8)) - 1e-9
        assert made.check(problem) == made.value


AGAIN = """
import numpy as np
import terrapath as tp
axis = np.arange(64.0)
surface = tp.Surface.from_grid(np.load({values!r}), axis, axis)
problem = tp.Problem(surface, (3.0, 4.0), (59.0, 59.5), obstacles=[tp.Circle(30.0, 32.0, 6.0)])
print(tp.Certificate.load({made!r}).check(problem))
"""


def test_a_certificate_is_proven_again_in_another_process(tmp_path):
    problem = rough(side=64, height=6.0, obstacles=[tp.Circle(30.0, 32.0, 6.0)])
    made = potential(problem)
    assert made.value > 1.02 * float(tp.chord(problem.surface, problem.start, problem.goal))
    values, file = tmp_path / "values.npy", tmp_path / "made.npz"
    np.save(values, heights(64, 6.0, 1))
    made.save(file)
    again = in_another_process(AGAIN.format(values=str(values), made=str(file)))
    assert again == made.value


def test_forged_claims_are_refused():
    problem = rough(side=64, height=6.0)
    made = potential(problem)
    assert made.check(problem) == made.value
    with pytest.raises(tp.CertificateError, match="the dual norm"):
        resealed(made, norm=made.norm * 0.999).check(problem)
    with pytest.raises(tp.CertificateError, match="the bound"):
        resealed(made, value=made.value * 1.0001).check(problem)
    with pytest.raises(tp.CertificateError, match="the dual norm"):
        resealed(made, coefficients=made.coefficients * 1.001).check(problem)
    with pytest.raises(tp.CertificateError):
        resealed(made, goal_core=made.start_core).check(problem)


def test_a_search_in_a_hurry_proves_what_it_has():
    problem = rough()
    asked = iter([False] * 40 + [True] * 10_000)
    found = list(
        spline_levels.spline_certificates(
            problem, problem.bounds, 1e-9, 10**6, lambda: next(asked), never
        )
    )
    assert len(found) == 1
    assert found[0].check(problem) == found[0].value
    # Without any time left, it is the chord or what is proven so far.
    late = potential_in_no_time(problem)
    assert late.check(problem) == late.value


def potential_in_no_time(problem):
    return next(
        spline_levels.spline_certificates(
            problem, problem.bounds, 1e-3, 10**6, lambda: True, lambda: True
        )
    )


def test_the_same_problem_has_the_same_certificate():
    problem = rough(side=64)
    assert potential(problem).seal == potential(problem).seal


# The checker


def test_the_norm_on_rough_ground_is_proven_to_be_what_samples_say():
    # Truncated models of whole cells find ten times as much likely here.
    problem = rough(side=24, height=60.0, seed=3)
    lattice = Lattice(problem.bounds, 24, 24)
    search = search_on(problem, lattice)
    claim = search.claim(search.c)
    needs = claims.cell_needs(problem, claim, 1e-3)
    norm = claims.proven_norm(problem, claim, needs.proven)
    exempt = claims.exempt_cells(problem, claim)
    t = np.linspace(0.0, 1.0, 33)
    worst = 0.0
    for j, i in np.argwhere(~exempt):
        x, y = lattice.x[i] + t * lattice.dx, lattice.y[j] + t * lattice.dy
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        sheet = oracles.Sheet(claim.coefficients, *lattice.bounds[:2], lattice.dx, lattice.dy)
        gradients = oracles.Terrain(problem.surface).gradients(points)
        squared = oracles.dual_norm_squared(sheet.gradient(points), gradients)
        worst = max(worst, math.sqrt(squared.max()))
    assert worst * (1.0 - 1e-9) <= norm <= worst * 1.01
    assert needs.likely.max() > 1.05 * worst


# The steps


def random_search(seed=0):
    problem = rough(side=20, height=6.0, seed=seed)
    return search_on(problem, Lattice(problem.bounds, 13, 17))


def test_the_flow_takes_away_what_the_slopes_bring():
    # <S grad c, p> = <c, sources of p>, where nothing is shrunk.
    search, random = random_search(), np.random.default_rng(0)
    search.places.limits[:] = 0.0
    c = random.normal(size=search.c.shape)
    zero = np.zeros_like(search.flow)
    slopes, sources = zero.copy(), np.empty_like(search.sources)
    args = search.places, search.basis
    kernels.step_flow(c, *args, np.float32(1.0), search.rows, slopes, sources)
    energy = float(np.square(slopes, dtype=float).sum())
    assert float((c * sources).sum()) == pytest.approx(energy, rel=1e-5)
    # And that is no more than the energy that steps are preconditioned by.
    smooth = search._solve(sources.copy())
    assert float((smooth * sources).sum()) <= energy * (1.0 + 1e-4)


def test_the_norms_are_those_of_the_surface():
    search = random_search(1)
    claim, lattice = search.claim(search.c), search.lattice
    sheet = oracles.Sheet(claim.coefficients, *lattice.bounds[:2], lattice.dx, lattice.dy)
    for j in (3, 8):
        kernels.fill_norms(search.c, search.places, search.basis, j, search.rows)
        q, p, i = (search.places.limits[:, :, j] < 2.0).nonzero()
        assert len(i) > 150
        x, y = lattice.x[i] + 0.25 * p * lattice.dx, lattice.y[j] + 0.25 * q * lattice.dy
        points = np.stack([x, y], axis=-1)
        gradients = oracles.Terrain(search.problem.surface).gradients(points)
        expected = np.sqrt(oracles.dual_norm_squared(sheet.gradient(points), gradients))
        np.testing.assert_allclose(search.rows.norms[q, p, i], expected, rtol=1e-4)


def test_a_finer_lattice_begins_with_the_same_function():
    random = np.random.default_rng(4)
    c = random.normal(size=(9, 5))
    finer = spline_levels._resampled(c, 13)
    place = np.linspace(0.0, 6.0, 97)
    for coefficients, nodes in ((c, 7), (finer, 13)):
        t = place * (nodes - 1) / 6.0
        k = np.minimum(t.astype(int), nodes - 2)
        s = (t - k)[:, None]
        shares = ((1 - s) ** 3, 3 * s**3 - 6 * s**2 + 4, -3 * s**3 + 3 * s**2 + 3 * s + 1, s**3)
        values = sum(share / 6 * coefficients[k + m] for m, share in enumerate(shares))
        if nodes == 7:
            expected = values
    np.testing.assert_allclose(values, expected, atol=1e-12)


def test_a_projection_lowers_the_norm_and_little_else():
    search = random_search(2)
    before, c = search.c.copy(), search.c.copy()
    everywhere = np.ones((search.lattice.ny, 1), bool)
    assert search._steep(c, 1.0, 0.0, everywhere)[1] > 1.05
    search.project(c, np.zeros((0, 2), np.int64), 8, 1.02, never)
    assert search._steep(c, 1.0, 0.0, everywhere)[1] < 1.03
    assert np.abs(c - before).max() < 2.0


def test_cores_are_as_large_as_asked_for():
    problem = rough()
    for most in (1, 3):
        ends = problem.start, problem.goal
        lattice = Lattice(problem.bounds, 90, 90)
        start, goal = (claims.Core(*block) for block in lattice.blocks_around(ends, most))
        assert start.column1 - start.column0 == goal.row1 - goal.row0 == 2 * most
