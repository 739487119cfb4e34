"""Certificates: bounds never above the truth, proofs that hold, forgeries that do not."""

from __future__ import annotations

import ast
import itertools
import math
import os
import pickle
import re
import zipfile
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
import shapely

import certificate_oracles as oracles
import planner_oracles
import terrapath as tp
from oracles import great_circle
from processes import in_another_process
from terrapath._kernels.certificates import norms as kernels
from terrapath._kernels.certificates import surface_models, taylor
from terrapath.certificates import certificate, claims
from terrapath.certificates.certificate import fingerprint, seal_of
from terrapath.certificates.claims import Core
from terrapath.certificates.search import Search, search_window
from terrapath.geodesics.rays import trace_ray
from terrapath.problem import scenes
from terrapath.space.lattice import Lattice
from test_optimality import FLAT, LAYOUTS, REGION
from test_random_problems import star

SIDE = 10.0
BOUNDS = (0.0, 0.0, SIDE, SIDE)
# Far above the rounding of an oracle's own sums, far below what any missing term would make.
ROUNDING = 1e-12


def certified(problem, side, length=math.inf, repairs=0):
    """A certificate on a lattice of so many nodes."""
    window = search_window(problem, length)
    spacing = max(window.width, window.height) / side
    search = Search(problem, Lattice.spanning(window, spacing), length * (1.0 + 1e-6))
    for _ in range(repairs):
        search.repair()
    return search.certify()


def random_peaks(random, layers, steepest=4.0):
    """Layers of peaks of all widths and signs, and their weights."""
    made = []
    for _ in range(layers):
        count = random.integers(1, 5)
        falloff = np.exp(random.uniform(math.log(0.02), math.log(4.0), count))
        slope = random.uniform(0.1, steepest, count) * random.choice([-1.0, 1.0], count)
        amplitude = slope * np.sqrt(math.e / (2.0 * falloff))
        made.append(np.column_stack([amplitude, falloff, random.uniform(0.0, SIDE, (count, 2))]))
    return made, random.choice([0.0, 0.3, 1.0, 1.0, 1.0, 2.5], layers)


def random_surface(random, layers, on_spline):
    """Peaks, or rough splines through few or many random samples."""
    if not on_spline:
        peaks, weights = random_peaks(random, layers)
        return tp.Surface.from_peaks(peaks, weights=weights)
    nx, ny = random.integers(4, 14, 2) if random.random() < 0.7 else random.integers(40, 70, 2)
    x, y = np.linspace(0.0, SIDE, nx), np.linspace(0.0, SIDE, ny)
    steep = random.uniform(0.0, 0.8) * SIDE / max(nx, ny)
    values = steep * random.normal(size=(layers, ny, nx))
    weights = random.choice([0.0, 0.3, 1.0, 1.0, 2.5], layers)
    return tp.Surface.from_grid(values, x, y, weights=weights)


# Models: polynomials and remainders


def random_model(random, positive):
    c = random.uniform(0.0, 1.0, 10) * 10.0 ** random.integers(-3, 2, 10)
    c = c if positive else c * random.choice([-1.0, 0.0, 1.0], 10)
    return taylor.Model(*c, random.choice([0.0, 0.1, 2.0]))


POWERS = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)]


def value_of(model, p, q):
    return sum(c * p**i * q**j for c, (i, j) in zip(model, POWERS, strict=False))


def square(count):
    """Points (p, q) all over [-1, 1]^2, its edges and corners among them."""
    axis = np.linspace(-1.0, 1.0, count)
    return (grid.ravel() for grid in np.meshgrid(axis, axis))


@pytest.mark.parametrize("seed", range(40))
def test_a_product_of_models_encloses_all_products(seed):
    random = np.random.default_rng(seed)
    p, q = square(9)
    f, g = random_model(random, positive=False), random_model(random, positive=False)
    product = taylor.times(f, g)
    centre = value_of(product, p, q)
    scale = max(abs(centre).max(), product.r, 1.0)
    for a, b in itertools.product((-1.0, 0.3, 1.0), repeat=2):
        true = (value_of(f, p, q) + a * f.r) * (value_of(g, p, q) + b * g.r)
        assert (abs(true - centre) <= product.r + ROUNDING * scale).all()


@pytest.mark.parametrize("seed", range(20))
def test_a_product_of_positive_models_is_attained_at_a_corner(seed):
    # Nothing is forgotten, and nothing is counted twice.
    random = np.random.default_rng(seed)
    f, g = random_model(random, positive=True), random_model(random, positive=True)
    product = taylor.times(f, g)
    assert sum(product) == pytest.approx(sum(f) * sum(g), rel=1e-13)
    for i in range(10):
        # By one coefficient of each: c_ij is a sum over the pairs that make p^i q^j.
        made = sum(
            f[m] * g[n]
            for m, n in itertools.product(range(10), repeat=2)
            if tuple(np.add(POWERS[m], POWERS[n])) == POWERS[i]
        )
        assert product[i] == pytest.approx(made, rel=1e-13)


def test_sums_and_multiples_of_models_are_taken_coefficient_by_coefficient():
    random = np.random.default_rng(0)
    f, g = random_model(random, positive=False), random_model(random, positive=False)
    np.testing.assert_allclose(taylor.plus(f, g), np.add(f, g), rtol=1e-15)
    difference = taylor.minus(f, g)
    np.testing.assert_allclose(difference[:10], np.subtract(f, g)[:10], rtol=1e-15)
    assert difference.r == f.r + g.r
    assert taylor.times_number(f, -3.0).r == 3.0 * f.r
    p, q = square(9)
    offsets = abs(value_of(f, p, q) - f.c00).max()
    assert offsets <= taylor.spread(f) - f.r + ROUNDING
    np.testing.assert_allclose(
        [taylor.polynomial(f, *place) for place in zip(p, q, strict=True)], value_of(f, p, q)
    )


@pytest.mark.parametrize("seed", range(20))
def test_a_tensor_product_encloses_and_is_attained(seed):
    random = np.random.default_rng(seed)
    s, t = (taylor.Series(*random.uniform(0.0, 1.0, 5)) for _ in range(2))
    factor = random.uniform(0.1, 3.0)
    model = taylor.tensor(s, t, factor)
    assert sum(model) == pytest.approx(factor * sum(s) * sum(t), rel=1e-13)
    assert taylor.tensor(s, t, -factor).r == pytest.approx(model.r, rel=1e-13)
    signs = random.choice([-1.0, 1.0], (2, 4))
    s, t = (taylor.Series(*(c[:4] * sign), c[4]) for c, sign in zip((s, t), signs, strict=True))
    model = taylor.tensor(s, t, -factor)
    p, q = square(9)
    for a, b in itertools.product((-1.0, 1.0), repeat=2):
        left = np.polyval(s[3::-1], p) + a * s.r
        right = np.polyval(t[3::-1], q) + b * t.r
        off = abs(-factor * left * right - value_of(model, p, q))
        assert (off <= model.r + ROUNDING).all()


def gaussian_errors(falloff, offset, a):
    """Largest errors of the two series of a Gaussian over t = offset +- a, beyond rounding."""
    pair = surface_models.gaussian(falloff, offset, a)
    p = np.linspace(-1.0, 1.0, 201)
    t = offset + a * p
    value = np.exp(-falloff * t * t)
    off = abs(np.polyval(pair.value[3::-1], p) - value).max()
    slope = abs(np.polyval(pair.slope[3::-1], p) + 2.0 * falloff * t * value).max()
    return pair, off, slope


@pytest.mark.parametrize("seed", range(40))
def test_the_series_of_a_gaussian_enclose_it_at_any_width(seed):
    random = np.random.default_rng(seed)
    falloff = np.exp(random.uniform(-7.0, 14.0))
    deviation = 1.0 / math.sqrt(2.0 * falloff)
    offset = deviation * random.choice([0.0, *random.uniform(-4.0, 4.0, 6)])
    for a in deviation * 10.0 ** np.arange(-3.0, 1.5, 0.5):
        pair, value, slope = gaussian_errors(falloff, offset, a)
        assert value <= pair.value.r + 1e-15
        assert slope <= pair.slope.r + 1e-14 * math.sqrt(falloff)


def test_the_remainders_of_a_gaussian_are_of_fourth_order_and_nearly_sharp():
    # Sharp where the fourth derivative is largest, at the centre of the peak: 12 of 13.04.
    widths = 2.0 ** -np.arange(3.0, 7.0)
    pairs = [gaussian_errors(0.5, 0.0, a) for a in widths]
    ratios = [pair.value.r / value for pair, value, _ in pairs]
    assert max(ratios) < 2.0
    # And of the derivative's where the fifth is, at 0.617 deviations.
    pairs = [gaussian_errors(0.5, 0.617, a) for a in widths]
    assert max(pair.slope.r / slope for pair, _, slope in pairs) < 2.0
    orders = np.polyfit(np.log(widths), np.log([pair.slope.r for pair, _, _ in pairs]), 1)
    assert 3.8 < orders[0] < 4.2


def test_the_series_of_a_gaussian_are_its_taylor_polynomials():
    with mpmath.workdps(40):
        for falloff, offset, a in ((0.5, 0.3, 0.2), (40.0, -0.11, 0.03), (1e-3, 5.0, 1.0)):
            pair = surface_models.gaussian(falloff, offset, a)

            def f(t, falloff=falloff):
                return mpmath.exp(-mpmath.mpf(falloff) * t * t)

            series = mpmath.taylor(f, mpmath.mpf(offset), 4)
            value = [float(c * mpmath.mpf(a) ** k) for k, c in enumerate(series[:4])]
            slope = [float((k + 1) * series[k + 1] * mpmath.mpf(a) ** k) for k in range(4)]
            np.testing.assert_allclose(pair.value[:4], value, rtol=1e-12)
            np.testing.assert_allclose(pair.slope[:4], slope, rtol=1e-12)


def test_the_series_of_bumps_are_the_b_splines():
    p = np.linspace(-1.0, 1.0, 11)
    for k, t, w in itertools.product(range(4), (0.5, 0.3, 0.9), (0.1, 0.05, 0.0)):
        expected = oracles.CARDINAL(t + w * p + 3 - k)
        series = surface_models.bump(k, t, w)
        assert series.r == 0.0
        np.testing.assert_allclose(np.polyval(series[3::-1], p), expected, atol=1e-15)


@pytest.mark.parametrize("seed", range(20))
def test_spline_models_enclose_the_spline_and_its_slopes(seed):
    random = np.random.default_rng(seed)
    height = random.choice([0.0, 1.0, 1e6])
    sheet = oracles.Sheet(height + random.normal(size=(7, 8)), 0.0, 0.0, 0.7, 1.3)
    i, j = int(random.integers(0, 5)), int(random.integers(0, 4))
    w, v = random.choice([0.5, 0.2, 0.01, 0.0], 2)
    t, s = random.uniform(w, 1.0 - w), random.uniform(v, 1.0 - v)
    layer = surface_models.spline_models(sheet.coefficients, i, j, t, s, w, v, sheet.dx, sheet.dy)
    p, q = square(9)
    points = np.column_stack([(i + t + w * p) * sheet.dx, (j + s + v * q) * sheet.dy])
    rounding = 1e-14 * max(height, 1.0)
    for model, along in ((layer.value, (0, 0)), (layer.slope_x, (1, 0)), (layer.slope_y, (0, 1))):
        off = abs(value_of(model, p, q) - sheet.at(points, *along)).max()
        assert off <= model.r + 4.0 * rounding
        # Terms beyond degree three are all that is missing.
        assert model.r <= 30.0 * max(w, v) ** 4 * 4.0
    assert abs(layer.value.c00) <= height + 10.0


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
    return kernels.Potential(coefficients, 0.0, 0.0, dx, dy)


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
    sheet, terrain, points = oracles.Sheet(*bound), oracles.Terrain(surface), points_of(box)
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
        bound = kernels.Potential(4.0 + random.normal(size=(4, 4)), 4.0, 4.0, 2.0, 2.0)
        place = 5.0 + width * random.uniform(-2.0, 2.0, 2)
        half = min(scale * width, 0.4)
        box = surface_models.Box(*np.clip(place, 4.4, 5.6), half, half)
        facts = facts_of(surface, bound, 0, 0, box, goal)
        sheet, terrain = oracles.Sheet(*bound), oracles.Terrain(surface)
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
            margin = kernels.margin_of_box(
                surface.data, bound, kernels.Anchor(goal, 1.0, math.inf), 0.9, 2, 2, box
            )
            sheet, terrain, points = (
                oracles.Sheet(*bound),
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


# Never above the truth: 2,000 problems

CYLINDERS, PLANES, RAYS, AMONG_OBSTACLES, ROUND_POLYGONS, CAPS = 640, 300, 520, 230, 150, 160


def check_bound(problem, truth, random, slack=0.0):
    """Bounds from any lattice and any belief about the length are at most the true length.

    Returns the gap of the last one.
    """
    side = int(random.choice([6, 9, 14, 20, 30, 40], p=[0.2, 0.2, 0.2, 0.2, 0.1, 0.1]))
    believed = truth * random.choice([0.3, 0.9, 1.0, 1.0 + 1e-9, 1.001, 1.1, 2.0, math.inf])
    repairs = int(random.random() < 0.2)
    made = certified(problem, side, believed, repairs)
    assert made.value <= truth * (1.0 + ROUNDING) + slack
    straight = float(tp.chord(problem.surface, problem.start, problem.goal))
    assert made.value >= straight * (1.0 - 1e-8) - 1e-10
    if random.random() < 0.2:
        assert made.check(problem) == made.value
    return truth / made.value - 1.0 if believed >= truth else math.nan


def places_near_anything(random, low=0.0, high=SIDE):
    """Two points: anywhere, near one another, near the edge or on it, in a corner."""
    ends = random.uniform(low, high, (2, 2))
    kind = random.integers(0, 8)
    if kind == 0:
        ends[1] = ends[0] + random.uniform(-0.3, 0.3, 2) * 10.0 ** -random.integers(0, 5)
    elif kind == 1:
        ends[0, 0] = random.choice([low, high])
    elif kind == 2:
        ends[1] = random.choice([low, high], 2)
    elif kind == 3:
        ends[1, 1] = ends[0, 1]
    elif kind == 4:
        ends[0] = ends[0].round()
    return np.clip(ends, low, high)


def numbered(total, seed, batches, batch):
    """Generators of random numbers of one batch of cases."""
    assert total % batches == 0
    each = total // batches
    return (np.random.default_rng([seed, n]) for n in range(batch * each, (batch + 1) * each))


def check_gaps(gaps, typical):
    """Half of the gaps where the length was known are typical or better."""
    gaps = np.array(gaps)
    assert (gaps[~np.isnan(gaps)] > -ROUNDING).all()
    assert np.nanmedian(gaps) < typical


@pytest.mark.parametrize("batch", range(10))
def test_no_bound_is_above_the_unrolled_straight_line(batch):
    # Layers that depend on x1 alone, as rough as any: isometric to the plane.
    gaps = []
    for random in numbered(CYLINDERS, 10, 10, batch):
        count = int(random.integers(4, 50))
        layers = int(random.integers(1, 5))
        x = np.linspace(0.0, SIDE, count)
        rough = random.choice([0.05, 0.3, 1.0]) * SIDE / count
        profiles = rough * random.normal(size=(layers, 1, count))
        y = np.linspace(0.0, SIDE, int(random.integers(4, 40)))
        surface = tp.Surface.from_grid(
            np.repeat(profiles, len(y), axis=1),
            x,
            y,
            weights=random.choice([0.0, 0.5, 1.0, 2.0], layers),
        )
        problem = tp.Problem(surface, *places_near_anything(random))
        truth = oracles.unrolled_length(surface.data, problem.start, problem.goal)
        gaps.append(check_bound(problem, truth, random))
    check_gaps(gaps, 0.2)


@pytest.mark.parametrize("batch", range(4))
def test_no_bound_is_above_the_straight_line_on_tilted_planes(batch):
    gaps = []
    for random in numbered(PLANES, 11, 4, batch):
        layers = int(random.integers(1, 5))
        slopes = random.normal(size=(layers, 2)) * random.choice([0.0, 0.1, 1.0, 10.0])
        weights = random.choice([0.0, 0.5, 1.0, 2.0], layers)
        x, y = (np.linspace(0.0, SIDE, int(n)) for n in random.integers(4, 30, 2))
        values = slopes[:, 0, None, None] * x + slopes[:, 1, None, None] * y[:, None]
        surface = tp.Surface.from_grid(values, x, y, weights=weights)
        problem = tp.Problem(surface, *places_near_anything(random))
        step = np.subtract(problem.goal, problem.start)
        truth = math.hypot(*step, *(weights * (slopes @ step)))
        gaps.append(check_bound(problem, truth, random))
    # The straight line in space is the bound already.
    check_gaps(gaps, 2e-9)


@pytest.mark.parametrize("batch", range(8))
def test_no_bound_is_above_a_geodesic(batch):
    # Any geodesic is a path, and a short one is the shortest.
    gaps = []
    for random in numbered(RAYS, 12, 8, batch):
        surface = random_surface(random, int(random.integers(1, 5)), random.random() < 0.4)
        start = tuple(places_near_anything(random)[0])
        length = random.choice([0.05, 1.0, 4.0, 10.0])
        bounds = tp.Problem(surface, start, start, BOUNDS).bounds
        ray = trace_ray(surface, start, random.uniform(0.0, 6.28), length, bounds=bounds)
        goal = np.clip(ray.points[-1], 0.0, SIDE)
        if ray.length < 1e-6:
            continue
        problem = tp.Problem(surface, start, goal, BOUNDS)
        # The ray's own error, and the end's clipping.
        gaps.append(check_bound(problem, ray.length, random, slack=1e-8 * ray.length))
    check_gaps(gaps, 0.1)


def random_obstacles(random):
    """Polygons with holes and without, discs, walls and a mask."""
    obstacles = []
    for _ in range(random.integers(0, 6)):
        radii = random.uniform(0.2, 1.8, random.integers(3, 10))
        hole = random.choice([0.0, 0.0, 0.6])
        shape = star(*random.uniform(0.0, SIDE, 2), radii, random.uniform(0.0, 6.28), hole)
        obstacles += [shape] if shape.is_valid else []
    for _ in range(random.integers(0, 4)):
        obstacles.append(tp.Circle(*random.uniform(0.0, SIDE, 2), random.uniform(0.1, 1.5)))
    for _ in range(random.integers(0, 3)):
        obstacles.append(shapely.LineString(random.uniform(0.0, SIDE, (3, 2))))
    if random.random() < 0.3:
        nx, ny = random.integers(4, 40, 2)
        blocked = random.random((ny, nx)) < random.choice([0.05, 0.3])
        x, y = ((np.arange(n) + 0.5) * SIDE / n for n in (nx, ny))
        obstacles.append(tp.Mask(blocked, x, y))
    if random.random() < 0.3:
        # Boxes whose sides lie on lines of the lattice.
        obstacles.append(shapely.box(*(random.integers(0, 3, 2) * 2.5), 7.5, 7.5))
    return obstacles


def problem_among_obstacles(random):
    while True:
        surface = random_surface(random, int(random.integers(1, 5)), random.random() < 0.4)
        obstacles = random_obstacles(random)
        for _ in range(5):
            try:
                return tp.Problem(surface, *places_near_anything(random), BOUNDS, obstacles)
            except tp.InputError:
                continue


@pytest.mark.parametrize("batch", range(10))
def test_no_bound_is_above_any_path_among_obstacles(batch):
    gaps, found = [], 0
    for random in numbered(AMONG_OBSTACLES, 13, 10, batch):
        problem = problem_among_obstacles(random)
        path = tp.RRTStar(samples=1_000, seed=int(random.integers(0, 1000))).solve(problem).path
        if path is None:
            made = certified(problem, 12)
            assert made.check(problem) == made.value
            continue
        found += 1
        if random.random() < 0.5:
            path = tp.refine(problem, path, tolerance=1e-4)
        gaps.append(check_bound(problem, path.length, random))
    assert found > 10
    check_gaps(gaps, 0.3)


def random_polygons(random):
    return [
        shapely.box(
            *(corner := random.uniform(-1.0, 9.0, 2)), *(corner + random.uniform(0.2, 4, 2))
        )
        if random.random() < 0.6
        else star(
            *random.uniform(0.0, SIDE, 2), random.uniform(0.5, 2.0, 3), random.uniform(0, 6), 0
        )
        for _ in range(random.integers(1, 5))
    ]


@pytest.mark.parametrize("batch", range(5))
def test_no_bound_on_flat_ground_is_above_the_visibility_graphs(batch):
    gaps = []
    for random in numbered(ROUND_POLYGONS, 14, 5, batch):
        polygons = random_polygons(random)
        ends = random.uniform(0.0, SIDE, (2, 2))
        while shapely.intersects(shapely.points(ends)[:, None], polygons).any():
            ends = random.uniform(0.0, SIDE, (2, 2))
        problem = tp.Problem(FLAT, *ends, BOUNDS, polygons)
        if problem.is_unreachable:
            continue
        truth = planner_oracles.visibility_length(problem.start, problem.goal, polygons, BOUNDS)
        gaps.append(check_bound(problem, truth, random))
    check_gaps(gaps, 0.02)


def cap_of_a_sphere(x, y):
    return np.sqrt(100.0 - x * x - y * y)


@pytest.mark.parametrize("batch", range(4))
def test_no_bound_is_above_the_great_circle(batch):
    surface = tp.Surface.from_function(cap_of_a_sphere, (-6.0, -6.0, 6.0, 6.0), tolerance=1e-5)
    gaps = []
    for random in numbered(CAPS, 15, 4, batch):
        # A disc of the sphere is convex, the square around it is not: what is straight between
        # points inside stays inside.
        angles, radii = random.uniform(0.0, 6.28, 2), random.uniform(0.0, 5.9, 2)
        ends = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        problem = tp.Problem(surface, *ends)
        truth = great_circle(10.0, *ends)
        # A gradient that is off by 1e-5 changes a length by that share of it at most.
        gaps.append(check_bound(problem, truth, random, slack=2e-5 * truth))
    assert np.nanmedian(gaps) < 0.01


def test_there_are_two_thousand_problems():
    assert CYLINDERS + PLANES + RAYS + AMONG_OBSTACLES + ROUND_POLYGONS + CAPS == 2_000


@pytest.mark.parametrize("name", LAYOUTS)
def test_bounds_on_flat_ground_are_near_the_visibility_graphs(name):
    polygons = LAYOUTS[name]
    problem = tp.Problem(FLAT, (0.0, 0.0), (10.0, 10.0), REGION, polygons)
    truth = planner_oracles.visibility_length((0.0, 0.0), (10.0, 10.0), polygons, REGION)
    found = tp.lower_bound(problem, length=truth)
    assert truth * (1.0 - 0.05) <= found.value <= truth * (1.0 + ROUNDING)
    assert found.check(problem) == found.value


# Forgeries


def resealed(made, **changes):
    """A certificate changed by one who knows how to seal it: mathematics alone rejects it."""
    changed = replace(made, **changes)
    return replace(changed, seal=seal_of(changed))


def nudged(made, row, column, by):
    coefficients = made.coefficients.copy()
    coefficients[row, column] += by
    return coefficients


def hills():
    return scenes.load("one-peak")


@pytest.fixture(scope="module")
def honest():
    """A certificate of the one-peak scene whose norm is within 1e-3 of 1."""
    problem = hills()
    length = scenes.SCENES["one-peak"].true_length
    made = certified(problem, 100, length * 1.02, repairs=2)
    assert made.norm < 1.001
    assert made.check(problem) == made.value
    return problem, made


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
    "bounds beyond": {"bounds": tp.validation.Bounds(-2.0, -1.0, 11.0, 11.0)},
    "bounds nan": {"bounds": tp.validation.Bounds(math.nan, -1.0, 11.0, 11.0)},
    "bounds turned": {"bounds": tp.validation.Bounds(11.0, 11.0, -1.0, -1.0)},
    "bounds empty": {"bounds": tp.validation.Bounds(-1.0, -1.0, -1.0, 11.0)},
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


# The checker is nobody's child


def imports_of(module):
    """Modules of this package that a source file imports, by their last names."""
    found = set()
    for node in ast.walk(ast.parse(Path(module.__file__).read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            inside = [node.module] if node.module else []
            found.update(inside if node.module not in (None, "_kernels") else ())
            if node.module in (None, "_kernels"):
                found.update(
                    f"{node.module or ''}.{alias.name}".lstrip(".") for alias in node.names
                )
        elif isinstance(node, ast.Import):
            assert not any("terrapath" in alias.name for alias in node.names)
    return found


def test_the_checker_shares_nothing_with_the_solver():
    assert imports_of(certificate) == {"errors", "files", "problem", "proofs", "validation"}
    assert imports_of(claims) == {
        "_kernels.certificate",
        "_kernels.surfaces",
        "errors",
        "lattice",
        "problem",
        "surface.costs",
        "validation",
    }
    assert imports_of(kernels) == {"compiler", "surface_models", "surfaces", "taylor"}
    assert imports_of(surface_models) == {"compiler", "dispatch", "surfaces", "taylor"}
    assert imports_of(taylor) == {"compiler"}
    loaded = in_another_process(
        "import json, sys, terrapath.certificate\n"
        "print(json.dumps([name for name in sys.modules if name.startswith('terrapath.')]))"
    )
    solvers = (
        "eikonal",
        "source_model",
        "bounding",
        "refinement",
        "planners",
        "geodesics",
        "grid_search",
    )
    assert not [name for name in loaded if name.split(".")[-1] in solvers]


# Files


def test_a_certificate_survives_the_disk(honest, tmp_path):
    problem, made = honest
    made.save(tmp_path / "made.npz")
    found = tp.Certificate.load(tmp_path / "made.npz")
    assert found.check(problem) == made.value
    assert found.seal == made.seal
    np.testing.assert_array_equal(found.coefficients, made.coefficients)
    assert [p.name for p in tmp_path.iterdir()] == ["made.npz"]
    for field in ("norm", "bounds", "horizon", "start_core", "goal_core", "fingerprint"):
        assert getattr(found, field) == getattr(made, field)


def one_line(path):
    with pytest.raises(tp.MapError) as caught:
        tp.Certificate.load(path)
    message = str(caught.value)
    assert message.startswith(f"{path} is not a certificate: ")
    assert "\n" not in message
    assert len(message) > len(f"{path} is not a certificate: ")


@pytest.fixture(scope="module")
def small():
    """A certificate of a few kilobytes."""
    problem = tp.Problem(FLAT, (1.0, 1.0), (9.0, 8.0), BOUNDS)
    return problem, certified(problem, 8)


def test_files_cut_short_are_told_in_one_line(small, tmp_path):
    path = tmp_path / "cut.npz"
    small[1].save(path)
    whole = path.read_bytes()
    for size in sorted({0, 1, 2, 4, 30, 100, *range(0, len(whole) - 1, 97), len(whole) - 1}):
        path.write_bytes(whole[:size])
        one_line(path)


def test_files_with_a_flipped_bit_are_not_believed(small, tmp_path):
    problem, made = small
    path = tmp_path / "flipped.npz"
    made.save(path)
    whole = path.read_bytes()
    random = np.random.default_rng(0)
    for place in random.integers(0, len(whole), 150).tolist():
        broken = bytearray(whole)
        broken[place] ^= 1 << int(random.integers(0, 8))
        path.write_bytes(broken)
        try:
            found = tp.Certificate.load(path)
        except tp.MapError as error:
            assert "\n" not in str(error)  # noqa: PT017
            continue
        try:
            assert found.check(problem) == made.value
        except tp.CertificateError:
            continue
        # Bits that mean nothing: dates and the like in the archive's directory.
        assert seal_of(found) == made.seal


class Payload:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def test_foreign_files_are_told_in_one_line_and_never_run(small, tmp_path):
    _, made = small
    path, trap = tmp_path / "foreign.npz", tmp_path / "trap"
    path.write_text("value = 3\nnorm = 1\n")
    one_line(path)
    np.savez(path, surprise=np.arange(3))
    one_line(path)
    with path.open("wb") as file:
        np.save(file, np.arange(3.0))
    one_line(path)
    path.write_bytes(pickle.dumps(Payload(trap)))
    one_line(path)
    fields = {name: getattr(made, name) for name in ("value", "norm", "horizon", "fingerprint")}
    fields |= {"bounds": np.array(made.bounds), "start_core": np.array(made.start_core)}
    fields |= {"goal_core": np.array(made.goal_core), "seal": made.seal}
    fields |= {"coefficients": made.coefficients}
    np.savez(path, **fields)
    assert tp.Certificate.load(path).seal == made.seal
    for name, wrong in (
        ("value", np.array([Payload(trap)], object)),
        ("coefficients", np.array([[Payload(trap)]], object)),
        ("coefficients", np.zeros(3)),
        ("coefficients", np.full((9, 9), math.nan)),
        ("coefficients", np.array([["a", "b"]])),
        ("start_core", np.zeros(3)),
        ("start_core", np.full(4, math.nan)),
        ("goal_core", np.zeros((4, 4))),
        ("bounds", np.zeros(4)),
        ("bounds", np.zeros(3)),
        ("norm", np.zeros(2)),
        ("horizon", "far"),
    ):
        np.savez(path, **{**fields, name: wrong})
        one_line(path)
    for name in fields:
        np.savez(path, **{key: value for key, value in fields.items() if key != name})
        one_line(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("value.npy", b"\x93NUMPY\x01\x00not a header")
    one_line(path)
    assert not trap.exists()
    with pytest.raises(tp.MapError, match=r"missing\.npz does not exist; check the path$"):
        tp.Certificate.load(tmp_path / "missing.npz")
    one_line(tmp_path)


def test_a_certificate_cannot_be_saved_where_nothing_can_be(small, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises((tp.MapError, OSError)):
        small[1].save(tmp_path / "file" / "made.npz")


# Numbers


def test_a_certificate_compares_as_its_value(small):
    _, made = small
    twin = replace(made)
    assert made == twin
    assert made <= twin
    assert made >= twin
    assert hash(made) == hash(twin) == hash(made.value)
    assert made == made.value
    assert made == np.float64(made.value)
    assert made < made.value + 1.0
    assert made > 1
    assert made != "much"
    assert float(made) == made.value
    assert sorted([made, replace(made, value=1.0)])[0].value == 1.0


# Gaps: not only true, but near


@pytest.mark.parametrize("name", [n for n, scene in scenes.SCENES.items() if scene.true_length])
def test_the_default_bounds_of_the_papers_scenes_are_within_a_hundredth(name):
    problem, truth = scenes.load(name), scenes.SCENES[name].true_length
    found = tp.lower_bound(problem, length=truth * (1.0 + 1e-7))
    assert found.check(problem) == found.value
    assert 0.99 * truth < found.value <= truth * (1.0 + 1e-9)


@pytest.mark.parametrize("name", ["one-peak", "four-peaks"])
def test_a_gap_of_a_thousandth_is_met_where_it_is_asked_for(name):
    problem, truth = scenes.load(name), scenes.SCENES[name].true_length
    seen = []
    found = tp.lower_bound(problem, length=truth * (1.0 + 1e-7), target_gap=1e-3, watch=seen.append)
    assert truth * (1.0 - 1e-3) <= found.value <= truth * (1.0 + 1e-9)
    assert found.check(problem) == found.value
    # What was seen on the way was worse, and true.
    assert all(other.value <= found.value for other in seen)


def test_bounds_come_nearer_on_finer_lattices():
    problem, truth = scenes.load("one-peak"), scenes.SCENES["one-peak"].true_length
    sides = np.array([30, 60, 120, 240])
    gaps = [truth / certified(problem, side, truth, repairs=2).value - 1.0 for side in sides]
    slope = np.polyfit(np.log(sides), np.log(gaps), 1)[0]
    assert -3.0 < slope < -1.0


def test_a_search_stops_when_told():
    problem = scenes.load("six-peaks")
    options = {"length": 17.02, "target_gap": 1e-9}
    first = tp.lower_bound(problem, length=17.02)
    assert tp.lower_bound(problem, time_limit=1e-9, **options).seal == first.seal
    assert tp.lower_bound(problem, watch=lambda _: True, **options).seal == first.seal


# Bad input

PEAK = tp.Surface.from_peaks([[(3.0, 0.5, 5.0, 5.0)]])


def check_odd(problem, longest=None, **options):
    """A bound is found without ado, is proven, and true; a path to compare it with may be given."""
    found = tp.lower_bound(problem, **options)
    assert found.check(problem) == found.value
    straight = float(tp.chord(problem.surface, problem.start, problem.goal))
    # Heights of 1e11 leave the thousandths open.
    height = float(np.abs(problem.surface.data[0]).max(initial=1.0))
    assert found.value >= straight * (1.0 - 1e-8) - 1e-13 * height
    if longest is None:
        longest = problem.straight_length
    assert found.value <= longest * (1.0 + ROUNDING)
    return found


def test_no_way_at_all_has_the_bound_0():
    for place in ((3.0, 3.0), (0.0, 0.0), (10.0, 4.0)):
        problem = tp.Problem(PEAK, place, place, BOUNDS)
        for options in ({}, {"length": 0.0}, {"target_gap": 1e-3}, {"length": math.inf}):
            assert check_odd(problem, 0.0, **options) == 0.0


@pytest.mark.parametrize("distance", 10.0 ** -np.arange(0.0, 17.0))
def test_ends_close_together(distance):
    for step in ((1.0, 0.0), (0.0, -1.0), (0.6, 0.8)):
        goal = tuple(4.0 + distance * np.array(step))
        problem = tp.Problem(PEAK, (4.0, 4.0), goal, BOUNDS)
        # Rounding alone makes lengths of less than 1e-12 on ground some units high uncertain.
        true = math.dist((4.0, 4.0), goal)
        for length in (None, problem.straight_length, math.inf):
            found = check_odd(problem, length=length)
            if distance < 1e-6:
                assert found.value >= true * (1.0 - 1e-7) - 1e-13


def test_strips_one_cell_wide():
    for width in (0.01, 1e-6, 1e-9):
        for k in range(2):
            bounds = [4.99, 4.99, 4.99 + width, 4.99 + width]
            start, goal = [4.99 + 0.5 * width] * 2, [4.99 + 0.5 * width] * 2
            bounds[k], bounds[k + 2], start[k], goal[k] = 0.0, SIDE, 0.0, SIDE
            problem = tp.Problem(PEAK, start, goal, bounds)
            found = check_odd(problem, length=problem.straight_length * 1.001)
            if width == 0.01:
                # There is but one way, over the peak.
                assert found.value > 0.95 * problem.straight_length
        flat = tp.Problem(FLAT, start, goal, bounds)
        assert check_odd(flat).value == pytest.approx(SIDE, rel=1e-8)


def mask_of(free, count=10, size=1.0):
    """All cells blocked but those named (row, column)."""
    blocked = np.ones((count, count), bool)
    for cell in free:
        blocked[cell] = False
    centres = (np.arange(count) + 0.5) * size
    return tp.Mask(blocked, centres, centres)


def test_all_free_space_in_one_cell():
    for bounds in (BOUNDS, (0.0, 0.0, 1000.0, 1000.0)):
        problem = tp.Problem(PEAK, (4.3, 4.5), (4.7, 4.6), bounds, [mask_of([(4, 4)])])
        check_odd(problem)
        check_odd(problem, length=1000.0)


@pytest.mark.parametrize(
    "obstacles",
    [
        [mask_of([(4, 4), (8, 8)])],
        [mask_of([(4, 4), (8, 8)]), shapely.box(0, 0, 4.2, 10)],
        [shapely.LineString([(6.0, -1.0), (6.0, 11.0)])],
        [shapely.box(0, 0, 8, 8) - shapely.box(4.4, 4.4, 4.6, 4.6)],
        [
            tp.Circle(6.5, 6.5, 1.0),
            shapely.LineString([(6.5, -1), (6.5, 6)]),
            shapely.box(6, 7, 7, 11),
        ],
    ],
)
def test_an_unreachable_goal_has_a_finite_bound_at_once(obstacles):
    problem = tp.Problem(PEAK, (4.5, 4.5), (8.7, 8.6), BOUNDS, obstacles)
    assert problem.is_unreachable
    for options in ({}, {"target_gap": 1e-6}, {"length": math.inf, "target_gap": 1e-6}):
        found = check_odd(problem, math.inf, **options)
        # A finer lattice is no use.
        assert max(found.lattice.nx, found.lattice.ny) <= 121


def test_ends_on_the_edge_and_in_the_corners():
    corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0), (10.0, 5.0), (3.3, 0.0)]
    for start, goal in itertools.permutations(corners, 2):
        check_odd(tp.Problem(PEAK, start, goal, BOUNDS))


STEEP = 0.5 * math.e  # falloff of a peak 100 high whose steepest slope is 100


@pytest.mark.parametrize("goal", [(9.0, 9.0), (9.0, 2.0), (5.0, 5.0), (5.3, 5.2)])
def test_slopes_of_a_hundred(goal):
    surface = tp.Surface.from_peaks([[(100.0, STEEP, 5.0, 5.0)]])
    slope = np.abs(surface.gradients(np.column_stack([np.linspace(5, 6, 999)] * 2)))
    assert np.hypot(*slope[:, 0].T).max() == pytest.approx(100.0, rel=1e-3)
    problem = tp.Problem(surface, (1.0, 1.0), goal, BOUNDS)
    path = tp.refine(problem, tp.RRTStar(samples=2_000).solve(problem).path)
    check_odd(problem, path.length, length=path.length)
    check_odd(problem, path.length)


def test_planes_of_slope_a_hundred():
    axis = np.linspace(0.0, SIDE, 7)
    for slope_x, slope_y in ((100.0, 0.0), (60.0, -80.0), (-100.0, 100.0)):
        surface = tp.Surface.from_grid(slope_x * axis + slope_y * axis[:, None], axis, axis)
        for goal in ((9.0, 9.0), (9.0, 1.0), (1.001, 9.0)):
            problem = tp.Problem(surface, (1.0, 1.0), goal)
            truth = problem.straight_length
            assert check_odd(problem, truth, length=truth).value == pytest.approx(truth, rel=1e-8)


@pytest.mark.parametrize(
    "peak",
    [(1.0, 1e12), (1e-100, 1e200), (1e-145, 1e307), (1e11, 0.5), (1e-300, 1e300), (1e5, 1e-9)],
)
def test_peaks_beyond_all_measure(peak):
    problem = tp.Problem(tp.Surface.from_peaks([[(*peak, 5.0, 5.0)]]), (1, 1), (9, 9), BOUNDS)
    check_odd(problem, math.inf)
    check_odd(problem, math.inf, length=20.0)


@pytest.mark.parametrize("on_spline", [False, True])
@pytest.mark.parametrize("size", [8.0, 1.0, 0.125])
def test_places_far_from_the_maps_origin(size, on_spline):
    # Northings of UTM, and features of metres down to centimetres; all numbers are dyadic, so
    # that the problem is the same there.
    def problem_of(offset):
        x, y = 2.0 * offset, offset
        surface = tp.Surface.from_peaks(
            [[(0.3 * size, 50.0 / size**2, x + size / 2, y + size / 2)]]
        )
        if on_spline:
            axis = np.linspace(0.0, size, 33)
            nodes = np.stack(np.meshgrid(x + axis, y + axis), axis=-1)
            values = 1000.0 + surface.values(nodes)[..., 0]
            surface = tp.Surface.from_grid(values, x + axis, y + axis)
        bounds = (x, y, x + size, y + size)
        ends = (x + size / 8, y + size / 8), (x + size * 0.875, y + size * 0.75)
        return tp.Problem(surface, *ends, bounds)

    offset = 2.0**22
    near, far = (problem_of(o) for o in (0.0, offset))
    lattice = Lattice.spanning(near.bounds, size / 40)
    here = Search(near, lattice, 2.0 * size).certify()
    moved = Lattice.spanning(far.bounds, size / 40)
    # The same function u over there proves the same, to nearly the last digit.
    there = replace(here, bounds=moved.bounds, fingerprint=certificate.fingerprint(far))
    there = replace(there, value=here.value * (1.0 - 1e-10), norm=here.norm * (1.0 + 1e-10))
    there = replace(there, seal=seal_of(there))
    assert there.check(far) == there.value
    check_odd(far)
    own = Search(far, moved, 2.0 * size).certify()
    assert own.check(far) == own.value == pytest.approx(here.value, rel=1e-3)
    too_low = replace(there, norm=0.9 * here.norm)
    with pytest.raises(tp.CertificateError, match="the dual norm"):
        replace(too_low, seal=seal_of(too_low)).check(far)


def test_a_height_far_from_zero_changes_nothing():
    random = np.random.default_rng(0)
    axis = np.linspace(0.0, SIDE, 12)
    values = 0.3 * random.normal(size=(12, 12))
    low, high = (
        tp.Problem(tp.Surface.from_grid(h + values, axis, axis), (1, 1), (9, 8))
        for h in (0.0, 2.0**20)
    )
    found = [certified(problem, 40, 14.0) for problem in (low, high)]
    assert found[1].check(high) == pytest.approx(found[0].value, rel=1e-7)


@pytest.mark.parametrize("size", [1e-3, 1e-6, 1e-9, 1e6, 1e12])
def test_regions_of_any_size_have_the_same_bound(size):
    def problem_of(size):
        peaks = [[(0.3 * size, 50.0 / size**2, size / 2, size / 2)]]
        ends = (0.1 * size, 0.15 * size), (0.9 * size, 0.8 * size)
        return tp.Problem(tp.Surface.from_peaks(peaks), *ends, (0.0, 0.0, size, size))

    unit, scaled = (certified(problem_of(s), 30, 1.2 * s) for s in (1.0, size))
    assert scaled.value == pytest.approx(size * unit.value, rel=1e-6)
    check_odd(problem_of(size))


@pytest.mark.parametrize("length", [5e-324, 1e-300, 1e-9, 1.0, 8.0, 1e20, 1e300, math.inf])
@pytest.mark.parametrize("goal", [(9.0, 8.0), (1.0, 9.0), (9.0, 1.0)])
def test_a_wrong_belief_about_the_length_makes_no_wrong_bound(length, goal):
    problem = tp.Problem(PEAK, (1.0, 1.0), goal, BOUNDS)
    check_odd(problem, length=length)


@pytest.mark.parametrize("name", ["length", "target_gap", "time_limit"])
@pytest.mark.parametrize("value", [math.nan, -1.0, "far", True, -math.inf])
def test_arguments_without_sense_are_told_in_one_line(name, value):
    problem = tp.Problem(PEAK, (1.0, 1.0), (9.0, 8.0), BOUNDS)
    with pytest.raises(tp.InputError, match=re.escape(f"{name}=")) as caught:
        tp.lower_bound(problem, **{name: value})
    assert "\n" not in str(caught.value)


def test_what_overflows_proves_nothing():
    infinite = kernels.Facts(math.inf, 1.0, math.nan, 1.0)
    for facts in (infinite, infinite._replace(norm=math.nan, sample=math.nan, chord=math.nan)):
        assert kernels.need_of_box(facts, 3.0).proven == math.inf
    assert kernels.need_of_box(kernels.Facts(4.0, 1.0, -math.inf, 1.0), 3.0).proven == 2.0
    assert kernels.need_of_box(kernels.Facts(4.0, 1.0, 3.0, 0.0), 3.0).proven == 0.0
    assert kernels.need_of_box(kernels.Facts(4.0, 1.0, 2.0, 1.0), 3.0).proven == 1.0
    surface = tp.Surface.from_peaks([[(1e-145, 1e307, 0.5, 0.5)]]).data
    bound = kernels.Potential(np.zeros((4, 4)), 0.0, 0.0, 1.0, 1.0)
    box = surface_models.Box(0.5, 0.5, 0.5, 0.5)
    anchor = kernels.Anchor(np.ones(3), 1.0, math.inf)
    assert kernels.margin_of_box(surface, bound, anchor, 1.0, 0, 0, box) == -math.inf


# Determinism

TINY = """
import json
import terrapath as tp
from terrapath.certificates.search import Search
from terrapath.lattice import Lattice
surface = tp.Surface.from_peaks([[(3.0, 0.5, 5.0, 5.0)], [(1.0, 0.2, 2.0, 7.0)]])
problem = tp.Problem(surface, (1.0, 1.0), (9.0, 8.0), (0.0, 0.0, 10.0, 10.0), [tp.Circle(5, 2, 1)])
made = Search(problem, Lattice.spanning(problem.bounds, 1.0), 16.0).certify()
assert made.check(problem) == made.value
print(json.dumps([made.value, made.norm, made.horizon, made.seal]))
"""


def test_the_same_problem_has_the_same_certificate_to_the_last_bit():
    first, second = (in_another_process(TINY) for _ in range(2))
    assert first == second
    problem = scenes.load("six-peaks")
    found = [tp.lower_bound(scenes.load("six-peaks"), length=17.1) for _ in range(2)]
    assert found[0].seal == found[1].seal
    assert found[0].check(problem) == found[1].value


def test_plain_python_proves_the_same():
    compiled, plain = (in_another_process(TINY, NUMBA_DISABLE_JIT=flag) for flag in ("0", "1"))
    np.testing.assert_allclose(plain[:3], compiled[:3], rtol=1e-12)
