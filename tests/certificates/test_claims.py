"""What is proven of a box, of a cell and of the edge of a core, beside samples."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest

import certificate_oracles as oracles
import terrapath as tp
from certificate_cases import BOUNDS, SIDE, certified, random_surface, square
from terrapath._kernels.certificates import margins, norms as kernels, surface_models
from terrapath._kernels.certificates.potentials import Potential
from terrapath.certificates import claims
from terrapath.certificates.claims import Core

# Facts: what is proven of a box


def random_bound(random):
    """A random u on a lattice over the bounds: rough, or nearly a distance."""
    nx, ny = (int(n) for n in random.integers(4, 9, 2))
    x, y = np.linspace(0.0, SIDE, nx), np.linspace(0.0, SIDE, ny)
    dx, dy = x[1] - x[0], y[1] - y[0]
    column, row = np.arange(-1, nx + 1), np.arange(-1, ny + 1)
    cone = np.hypot(column * dx - 3.0, row[:, None] * dy + 2.0)
    rough = random.choice([0.01, 0.3, 3.0])
    coefficients = cone + rough * random.normal(size=(ny + 2, nx + 2))
    return Potential(coefficients, 0.0, 0.0, dx, dy, False)


def random_box(random, bound, surface):
    """A box inside one cell of u, and inside one of the surface's if that is a spline."""
    rows, columns = bound.coefficients.shape
    i, j = int(random.integers(0, columns - 3)), int(random.integers(0, rows - 3))
    low = np.array([i * bound.dx, j * bound.dy])
    high = low + np.array([bound.dx, bound.dy])
    place = random.uniform(low, high)
    data = surface.data
    if hasattr(data, "dx"):
        step = np.array([data.dx, data.dy])
        low = np.maximum(low, np.floor(place / step) * step)
        high = np.minimum(high, np.floor(place / step) * step + step)
    centre = random.uniform(low, high)
    room = np.minimum(centre - low, high - centre)
    return i, j, surface_models.Box(*centre, *(room * random.choice([1.0, 0.3, 0.01])))


def facts_of(surface, bound, i, j, box, goal):
    work = np.empty((2 * len(surface.data.weights), 11))
    return kernels.facts_of_box(surface.data, bound, goal, i, j, box, work)


def points_of(box, count=9):
    p, q = square(count)
    return np.column_stack([box.x + box.a * p, box.y + box.b * q])


def sampled_facts(surface, bound, box, goal):
    """The largest squared norm, the lowest u and the shortest chord in samples of a box."""
    sheet, terrain, points = oracles.Sheet(*bound[:5]), oracles.Terrain(surface), points_of(box)
    norm = oracles.dual_norm_squared(sheet.gradient(points), terrain.gradients(points))
    chords = np.linalg.norm(terrain.lift(points) - goal, axis=1)
    return norm, sheet.at(points).min(), chords.min()


@pytest.mark.parametrize("seed", range(200))
def test_the_facts_of_a_box_are_never_beyond_its_samples(seed):
    random = np.random.default_rng([1, seed])
    surface = random_surface(random, int(random.integers(1, 5)), on_spline=seed % 2 == 0)
    bound = random_bound(random)
    goal = oracles.Terrain(surface).lift(random.uniform(0.0, SIDE, (1, 2)))[0]
    for _ in range(12):
        i, j, box = random_box(random, bound, surface)
        facts = facts_of(surface, bound, i, j, box, goal)
        norm, lowest, chord = sampled_facts(surface, bound, box, goal)
        assert facts.norm >= norm.max() * (1.0 - 1e-11)
        assert facts.lowest <= lowest + 1e-12
        assert facts.chord <= chord * (1.0 + 1e-11)
        # No sample of a proof's own is above the truth.
        assert facts.least <= norm.max() * (1.0 + 1e-11)
        if box.a < 0.02 and box.b < 0.02:
            # Small boxes tell the truth: a sample is one of them, and so is the sample's norm.
            assert facts.sample == pytest.approx(norm.max(), rel=0.05)


@pytest.mark.parametrize("falloff", [1.0, 30.0, 1e3, 1e5])
def test_the_facts_of_a_box_hold_on_needles(falloff):
    # Peaks far narrower than the box, with slopes of 100.
    random = np.random.default_rng(int(falloff))
    amplitude = 100.0 * math.sqrt(math.e / (2.0 * falloff))
    surface = tp.Surface.from_peaks([[(amplitude, falloff, 5.0, 5.0)], [(1.0, 0.1, 4.0, 4.0)]])
    width = 1.0 / math.sqrt(2.0 * falloff)
    goal = oracles.Terrain(surface).lift(np.array([[5.2, 4.9]]))[0]
    for scale in (30.0, 3.0, 0.3, 0.03):
        bound = Potential(4.0 + random.normal(size=(4, 4)), 4.0, 4.0, 2.0, 2.0, False)
        place = 5.0 + width * random.uniform(-2.0, 2.0, 2)
        half = min(scale * width, 0.4)
        box = surface_models.Box(*np.clip(place, 4.4, 5.6), half, half)
        facts = facts_of(surface, bound, 0, 0, box, goal)
        sheet, terrain = oracles.Sheet(*bound[:5]), oracles.Terrain(surface)
        points = points_of(box, 81)
        norm = oracles.dual_norm_squared(sheet.gradient(points), terrain.gradients(points))
        assert facts.norm >= norm.max() * (1.0 - 1e-9)
        assert facts.chord <= np.linalg.norm(terrain.lift(points) - goal, axis=1).min() + 1e-12


@pytest.mark.parametrize("seed", range(8))
def test_the_facts_of_a_box_hold_in_exact_arithmetic(seed):
    random = np.random.default_rng([2, seed])
    layers = int(random.integers(1, 4))
    on_spline = seed % 2 == 0
    surface = random_surface(random, layers, on_spline)
    bound = random_bound(random)
    i, j, box = random_box(random, bound, surface)
    facts = facts_of(surface, bound, i, j, box, np.zeros(2 + layers))
    data = surface.data
    with mpmath.workdps(50):
        for p, q in itertools.product((-1.0, -0.4, 0.3, 1.0), repeat=2):
            x, y = (Fraction(float(c)) for c in (box.x + p * box.a, box.y + q * box.b))
            slope = [
                oracles.exact_sheet(
                    bound.coefficients,
                    i,
                    j,
                    x / Fraction(bound.dx) - i,
                    y / Fraction(bound.dy) - j,
                    *along,
                )
                / Fraction(step)
                for along, step in (((1, 0), bound.dx), ((0, 1), bound.dy))
            ]
            gradients = [exact_gradient(data, layer, x, y, on_spline) for layer in range(layers)]
            if not on_spline:
                slope = [mpmath.mpf(c.numerator) / c.denominator for c in slope]
            norm = float(oracles.exact_dual_norm_squared(slope, gradients))
            assert facts.norm >= norm * (1.0 - 1e-12)


def exact_gradient(data, layer, x, y, on_spline):
    if not on_spline:
        peaks = data.peaks[data.first[layer] : data.first[layer + 1]].tolist()
        place = (mpmath.mpf(c.numerator) / c.denominator for c in (x, y))
        return oracles.exact_peaks_gradient(peaks, float(data.weights[layer]), *place)
    t, s = (x - Fraction(data.x0)) / Fraction(data.dx), (y - Fraction(data.y0)) / Fraction(data.dy)
    rows, columns = data.coefficients.shape[1:]
    i, j = min(math.floor(t), columns - 4), min(math.floor(s), rows - 4)
    weight = Fraction(float(data.weights[layer]))
    return [
        weight
        * oracles.exact_sheet(data.coefficients[layer], i, j, t - i, s - j, *along)
        / Fraction(step)
        for along, step in (((1, 0), data.dx), ((0, 1), data.dy))
    ]


@pytest.mark.parametrize("on_spline", [False, True])
def test_the_facts_of_a_box_close_in_at_second_order(on_spline):
    random = np.random.default_rng(7)
    halves = 0.2 * 2.0 ** -np.arange(6.0)
    loose = np.zeros((30, 3, len(halves)))
    for case in loose:
        surface = random_surface(random, 2, on_spline=False)
        if on_spline:
            axis = np.linspace(0.0, SIDE, 6)
            nodes = np.stack(np.meshgrid(axis, axis), axis=-1)
            values = np.moveaxis(surface.values(nodes), -1, 0)
            surface = tp.Surface.from_grid(values, axis, axis)
        bound = random_bound(random)._replace(dx=2.0, dy=2.0)
        goal = np.full(4, -7.0)
        x, y = random.uniform(4.3, 5.7, 2)
        for m, half in enumerate(halves):
            box = surface_models.Box(x, y, half, half)
            facts = facts_of(surface, bound, 2, 2, box, goal)
            norm, lowest, _ = sampled_facts(surface, bound, box, goal)
            margin = margins.margin_of_box(
                surface.data, bound, margins.Anchor(goal, 1.0, math.inf), 0.9, 2, 2, box
            )
            sheet, terrain, points = (
                oracles.Sheet(*bound[:5]),
                oracles.Terrain(surface),
                points_of(box),
            )
            chord = np.linalg.norm(terrain.lift(points) - goal, axis=1)
            truth = (chord + 0.9 * sheet.at(points)).min()
            case[:, m] = facts.norm - norm.max(), lowest - facts.lowest, truth - margin
    assert (loose > -1e-12).all()
    for order in np.median(loose, axis=0):
        slope = np.polyfit(np.log(halves), np.log(order), 1)[0]
        assert 1.75 < slope < 2.5


# Cells: pieces, knots, ways out, the edges of cores


def sample_cells(problem, made, count=9):
    """At count x count points of each cell (ny, nx): the largest norm, and the largest need."""
    lattice = made.lattice
    shares = (np.arange(count) + 0.5) / count
    shares[0], shares[-1] = 0.0, 1.0
    x = (lattice.x[:-1, None] + lattice.dx * shares).ravel()
    y = (lattice.y[:-1, None] + lattice.dy * shares).ravel()
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    norm, way_out = oracles.needs_of(problem, made, points)
    shape = lattice.ny - 1, count, lattice.nx - 1, count
    return [field.reshape(shape).max(axis=(1, 3)) for field in (norm, np.minimum(norm, way_out))]


def random_problem(random, *, on_spline=None, layers=None):
    on_spline = random.random() < 0.5 if on_spline is None else on_spline
    surface = random_surface(random, layers or int(random.integers(1, 5)), on_spline)
    return tp.Problem(surface, *random.uniform(0.0, SIDE, (2, 2)), BOUNDS)


@pytest.mark.parametrize("seed", range(24))
def test_what_a_cell_needs_covers_all_samples_of_it(seed):
    random = np.random.default_rng([3, seed])
    problem = random_problem(random, on_spline=seed % 2 == 0)
    made = certified(problem, int(random.integers(6, 14)))
    steepest, needed = sample_cells(problem, made)
    needs = claims.cell_needs(problem, made, 0.0)
    exempt = claims.exempt_cells(problem, made)
    assert (needs.proven[exempt] == 0.0).all()
    assert (needs.proven[~exempt] >= needed[~exempt] * (1.0 - 1e-12)).all()
    norm = claims.proven_norm(problem, made, needs.proven)
    assert norm >= needed[~exempt].max(initial=0.0) * (1.0 - 1e-12)
    # Where the norm alone settles it, cutting cells up loses nothing.
    assert norm <= 1.05 * max(steepest[~exempt].max(), needs.likely.max())


@pytest.mark.parametrize("seed", range(24))
def test_the_margin_of_a_core_is_below_all_samples_of_its_edge_and_near(seed):
    random = np.random.default_rng([4, seed])
    problem = random_problem(random, on_spline=seed % 2 == 0)
    made = certified(problem, 12)
    lattice = made.lattice
    factor = random.choice([-1.0, -0.7, 0.0, 1.0])
    core = Core(
        *sorted(random.choice(lattice.nx, 2, replace=False)),
        *sorted(random.choice(lattice.ny, 2, replace=False)),
    )
    core = Core(*(int(k) for k in core))
    anchor = oracles.Terrain(problem.surface).lift(np.array([problem.goal]))[0]
    shifted = anchor - np.concatenate([problem.start, np.zeros(len(anchor) - 2)])
    margin = claims.edge_margin(problem, made, claims.End(core, problem.goal, shifted, 0.0), factor)
    x = np.linspace(lattice.x[core.column0], lattice.x[core.column1], 401)
    y = np.linspace(lattice.y[core.row0], lattice.y[core.row1], 401)
    edge = np.concatenate(
        [
            np.stack(np.broadcast_arrays(*side), axis=-1)
            for side in ((x, y[0]), (x, y[-1]), (x[0], y), (x[-1], y))
        ]
    )
    terrain, sheet = oracles.Terrain(problem.surface), oracles.sheet_of(made)
    chord = np.linalg.norm(terrain.lift(edge) - anchor, axis=1)
    sampled = (chord + factor * sheet.at(edge)).min()
    assert margin <= sampled + 1e-11
    assert margin >= sampled - 0.02 * SIDE


def test_knots_cut_cells_and_never_leave_a_piece_of_no_width():
    cuts = np.empty(40)
    for nx, low, high in itertools.product((4, 5, 30), (0.0, 0.1, 2.0 / 3.0, 5.0), (5.5, 10.0)):
        axis = np.linspace(0.0, SIDE, nx)
        spline = tp.Surface.from_grid(np.zeros((nx, nx)), axis, axis).data
        for offset in (0.0, 1e-13, -1e-13):
            begin = low + offset
            count = surface_models.cut_at_knots(spline, 0, begin, high, cuts)
            pieces = cuts[: count + 1]
            assert pieces[0] == begin
            assert pieces[-1] == high
            assert (np.diff(pieces) > 1e-10).all()
            inside = axis[1:-1][(axis[1:-1] > begin + 1e-9) & (axis[1:-1] < high - 1e-9)]
            np.testing.assert_allclose(pieces[1:-1], inside, rtol=1e-12)


def test_what_overflows_proves_nothing():
    infinite = kernels.Facts(math.inf, 1.0, 1.0, math.nan, 1.0)
    for facts in (infinite, infinite._replace(norm=math.nan, sample=math.nan, chord=math.nan)):
        assert kernels.need_of_box(facts, 3.0).proven == math.inf
    assert kernels.need_of_box(kernels.Facts(4.0, 1.0, 1.0, -math.inf, 1.0), 3.0).proven == 2.0
    assert kernels.need_of_box(kernels.Facts(4.0, 1.0, 1.0, 3.0, 0.0), 3.0).proven == 0.0
    assert kernels.need_of_box(kernels.Facts(4.0, 1.0, 1.0, 2.0, 1.0), 3.0).proven == 1.0
    surface = tp.Surface.from_peaks([[(1e-145, 1e307, 0.5, 0.5)]]).data
    bound = Potential(np.zeros((4, 4)), 0.0, 0.0, 1.0, 1.0, False)
    box = surface_models.Box(0.5, 0.5, 0.5, 0.5)
    anchor = margins.Anchor(np.ones(3), 1.0, math.inf)
    assert margins.margin_of_box(surface, bound, anchor, 1.0, 0, 0, box) == -math.inf
