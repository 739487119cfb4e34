"""Smoothing: exact on known functions, its change measured, and paths that converge."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import quad
from scipy.ndimage import gaussian_filter1d

import terrapath as tp
from common import one_line, points_in
from terrapath.io.bands import quantisation_step
from terrapath.paper import nonsmooth
from terrapath.surface.smoothing import scale_for_step, smooth

BOUNDS = (-5.0, -5.0, 5.0, 5.0)
scales = st.floats(0.05, 4.0)
seeds = st.integers(0, 2**32 - 1)


def axes(x=(-5.0, 5.0, 81), y=(-4.0, 3.0, 61)):
    return np.linspace(*x), np.linspace(*y)


def cone(x, y):
    return 3.0 - np.hypot(x, y)


def cliff(x, y):
    return np.heaviside(x, 0.5) + 0.0 * y


# What smoothing does to values


def smooth_by_padding(values, scales_in_samples):
    """The oracle: odd reflection written out, then SciPy's Gaussian filter."""
    for axis, scale in zip((2, 1), scales_in_samples, strict=True):
        count, reach = values.shape[axis], math.ceil(9.0 * scale)
        pad = [(reach, reach) if k == axis else (0, 0) for k in range(3)]
        padded = np.pad(values, pad, mode="reflect", reflect_type="odd")
        filtered = gaussian_filter1d(padded, scale, axis=axis, truncate=8.5)
        values = np.take(filtered, range(reach, reach + count), axis=axis)
    return values


@given(seeds, st.floats(2.0, 30.0), st.floats(2.0, 30.0))
@settings(deadline=None, max_examples=30)
def test_smoothing_is_scipys_gaussian_filter_of_the_values_reflected_oddly(seed, along_x, along_y):
    values = np.random.default_rng(seed).normal(size=(2, 17, 24))
    found = smooth(values, 1.0 / along_x, 1.0 / along_y, 1.0)
    np.testing.assert_allclose(found, smooth_by_padding(values, (along_x, along_y)), atol=1e-9)


@given(scales, st.tuples(*[st.floats(-3.0, 3.0)] * 3))
@settings(deadline=None, max_examples=30)
def test_a_plane_is_unchanged_up_to_the_edge(scale, plane):
    a, b, c = plane
    x, y = axes()
    surface = tp.Surface.from_grid(a + b * x + c * y[:, None], x, y, smoothing=scale)
    points = np.stack(np.meshgrid([-5.0, 0.13, 5.0], [-4.0, 1.37, 3.0]), axis=-1)
    expected = a + b * points[..., 0] + c * points[..., 1]
    np.testing.assert_allclose(surface.values(points)[..., 0], expected, atol=1e-12)
    np.testing.assert_allclose(surface.gradients(points)[..., 0, :], [[(b, c)] * 3] * 3, atol=1e-10)
    assert surface.fit.smoothing.largest_change[0] < 1e-12


@pytest.mark.parametrize("scale", [0.2, 0.35])
def test_a_quadratic_changes_by_half_the_laplacian_times_the_squared_scale(scale):
    def f(x, y):
        return 0.7 * x**2 - 1.9 * y**2 + 0.4 * x * y + x

    x, y = axes()
    surface = tp.Surface.from_grid(f(*np.meshgrid(x, y)), x, y, smoothing=scale)
    points = points_in((-2.0, -1.0, 2.0, 0.5), 200)
    expected = f(*points.T) + 0.5 * scale**2 * (2.0 * 0.7 - 2.0 * 1.9)
    np.testing.assert_allclose(surface.values(points)[:, 0], expected, atol=1e-9)


def test_a_scale_below_the_spacing_smooths_by_as_much_as_it_says():
    x, y = axes((0.0, 100.0, 101), (0.0, 100.0, 101))
    values = (x - 50.0) ** 2 + 0.0 * y[:, None]
    surface = tp.Surface.from_grid(values, x, y, smoothing=0.5)
    assert surface.values((50, 50))[0] == pytest.approx(0.25, rel=1e-4)
    assert surface.resolution == 1.0


def wider(amplitude, falloff, scale):
    """A Gaussian peak exp(-falloff r^2) smoothed: its amplitude and its falloff."""
    grown = 1.0 + 2.0 * falloff * scale**2
    return amplitude / grown, falloff / grown


@pytest.mark.parametrize("scale", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("made", ["grid", "unequal steps", "function"])
def test_a_smoothed_gaussian_peak_is_the_wider_gaussian(made, scale):
    peak = (2.0, 1.3, 0.2, -0.4)
    exact = tp.Surface.from_peaks([[(*wider(*peak[:2], scale), *peak[2:])]])

    def f(x, y):
        return peak[0] * np.exp(-peak[1] * ((x - peak[2]) ** 2 + (y - peak[3]) ** 2))

    if made == "function":
        surface = tp.Surface.from_function(f, BOUNDS, smoothing=scale)
    else:
        u = np.linspace(-1.0, 1.0, 301)
        x = 5.0 * (u if made == "grid" else u + 0.1 * np.sin(np.pi * u) / np.pi)
        y = np.linspace(-5.0, 5.0, 201)
        surface = tp.Surface.from_grid(f(*np.meshgrid(x, y)), x, y, smoothing=scale)
    points = points_in((-3.0, -3.0, 3.0, 3.0), 1000)
    np.testing.assert_allclose(surface.values(points), exact.values(points), atol=1e-6)
    np.testing.assert_allclose(surface.gradients(points), exact.gradients(points), atol=1e-4)


def test_layers_are_smoothed_each_by_itself_and_weights_have_no_say():
    def f(x, y):
        return np.stack([cone(x, y), 10.0 * cliff(x, y)])

    both = tp.Surface.from_function(f, BOUNDS, smoothing=0.3, weights=[1.0, 5.0])
    points = points_in(BOUNDS, 50)
    for k, single in enumerate([cone, lambda x, y: 10.0 * cliff(x, y)]):
        alone = tp.Surface.from_function(single, BOUNDS, smoothing=0.3)
        np.testing.assert_allclose(both.values(points)[:, k], alone.values(points)[:, 0])
        assert both.fit.smoothing.largest_change[k] == alone.fit.smoothing.largest_change[0]
    assert both.data.weights[1] == 5.0


def test_an_expression_is_smoothed_like_the_function_that_it_names():
    shown = tp.Surface.from_expression("3 - sqrt(x1**2 + x2**2)", BOUNDS, smoothing=0.3)
    points = points_in(BOUNDS, 50)
    expected = tp.Surface.from_function(cone, BOUNDS, smoothing=0.3).values(points)
    np.testing.assert_allclose(shown.values(points), expected, atol=1e-12)


def test_a_function_is_asked_within_the_bounds_only():
    def f(x, y):
        assert max(np.abs(x).max(), np.abs(y).max()) <= 5.0
        return cone(x, y)

    tp.Surface.from_function(f, BOUNDS, smoothing=2.0)


# The change is measured


@pytest.mark.parametrize("unequal", [False, True], ids=["equal", "unequal"])
def test_the_change_of_a_grid_is_what_comparing_two_surfaces_finds(unequal):
    x, y = axes()
    if unequal:
        x = x + 0.03 * np.sin(5.0 * np.arange(len(x)))
    values = np.stack([cone(*np.meshgrid(x, y)), np.random.default_rng(0).normal(size=(61, 81))])
    sharp = tp.Surface.from_grid(values, x, y)
    surface = tp.Surface.from_grid(values, x, y, smoothing=0.4)
    samples = np.stack(np.meshgrid(x, y), axis=-1)
    change = (surface.values(samples) - sharp.values(samples)).reshape(-1, 2)
    found = surface.fit.smoothing
    assert found.scale == 0.4
    assert found.largest_change == pytest.approx(np.abs(change).max(axis=0), rel=1e-9)
    assert found.rms_change == pytest.approx(np.sqrt((change**2).mean(axis=0)), rel=1e-9)
    assert surface.fit.value_error == sharp.fit.value_error


def test_the_change_of_a_function_is_what_a_dense_sampling_finds():
    surface = tp.Surface.from_function(cone, BOUNDS, smoothing=0.4)
    x = np.linspace(-5.0, 5.0, 1001)
    points = np.stack(np.meshgrid(x, x), axis=-1)
    change = surface.values(points)[..., 0] - cone(*np.moveaxis(points, -1, 0))
    assert surface.fit.smoothing.largest_change[0] == pytest.approx(np.abs(change).max(), rel=1e-3)
    assert surface.fit.smoothing.rms_change[0] == pytest.approx(
        np.sqrt((change**2).mean()), rel=1e-2
    )


@pytest.mark.parametrize("scale", [0.4, 0.2, 0.1])
def test_a_cones_apex_sinks_by_the_mean_distance_of_a_gaussian(scale):
    surface = tp.Surface.from_function(cone, BOUNDS, smoothing=scale)
    sinks = scale * math.sqrt(0.5 * math.pi)
    assert 3.0 - surface.values((0, 0))[0] == pytest.approx(sinks, rel=2e-4)
    assert surface.fit.value_error < 2e-3 * surface.fit.smoothing.largest_change[0]


@pytest.mark.parametrize("offset", [0.0, 0.001, 0.007])
def test_a_smoothed_cliff_is_within_the_error_reported_of_the_error_function(offset):
    surface = tp.Surface.from_function(
        lambda x, y: cliff(x - offset, y), (-1, -1, 1, 1), smoothing=0.1
    )
    points = points_in((-1, -1, 1, 1), 2000)
    exact = [0.5 * math.erfc((offset - x) / (0.1 * math.sqrt(2.0))) for x in points[:, 0]]
    assert np.abs(surface.values(points)[:, 0] - exact).max() <= surface.fit.value_error
    assert surface.fit.value_error < 0.06


def test_smoothed_features_set_the_resolution():
    x, y = axes()
    values = cone(*np.meshgrid(x, y))
    spacing = tp.Surface.from_grid(values, x, y).resolution
    assert tp.Surface.from_grid(values, x, y, smoothing=0.1).resolution == spacing
    assert tp.Surface.from_grid(values, x, y, smoothing=1.0).resolution == 0.5
    assert tp.Surface.from_function(cone, BOUNDS, smoothing=0.3).resolution == 0.15


def test_lengths_on_a_smoothed_cliff_are_found_to_nine_digits_from_one_end_to_the_other():
    surface = tp.Surface.from_function(cliff, BOUNDS, smoothing=0.1)
    across = tp.curve_length(surface, [(-5, -1), (5, 2)])
    cut = np.linspace((-5, -1), (5, 2), 4001)
    assert across == pytest.approx(tp.curve_length(surface, cut), rel=1e-9)


def test_repr_names_the_scale_and_the_change():
    surface = tp.Surface.from_function(
        lambda x, y: np.stack([cone(x, y), cliff(x, y)]), BOUNDS, smoothing=0.4
    )
    assert "smoothed over 0.4, change at most 0.5, 0.46, rms 0.04, 0.0" in repr(surface)
    x, y = axes()
    plain = tp.Surface.from_grid(cone(*np.meshgrid(x, y)), x, y)
    assert "smoothed" not in repr(plain)
    assert plain.fit.smoothing is None


@pytest.mark.parametrize("nothing", [None, 0, 0.0])
def test_no_scale_is_no_smoothing(nothing):
    x, y = axes()
    values = np.random.default_rng(1).normal(size=(61, 81))
    surface = tp.Surface.from_grid(values, x, y, smoothing=nothing)
    plain = tp.Surface.from_grid(values, x, y)
    np.testing.assert_array_equal(surface.data.coefficients, plain.data.coefficients)
    assert surface.fit.smoothing is None
    assert tp.Surface.from_function(np.multiply, (0, 0, 1, 1), smoothing=nothing).fit.gradient_error


# Errors


@pytest.mark.parametrize(
    ("smoothing", "shown"),
    [
        (-1.0, "smoothing=-1 must be"),
        (math.nan, "smoothing=nan"),
        (math.inf, "smoothing=inf"),
        ("1", "smoothing='1'"),
        (True, "smoothing=True"),
        (7.5, "smoothing=7.5 is larger than the map's shorter side, 7"),
    ],
)
def test_scales_that_make_no_sense_are_refused_with_the_value(smoothing, shown):
    x, y = axes()
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_grid(np.zeros((61, 81)), x, y, smoothing=smoothing)
    assert shown in one_line(caught)
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_function(cone, (-5, -4, 5, 3), smoothing=smoothing)
    assert shown in one_line(caught)


def test_a_scale_that_needs_too_many_samples_is_refused_with_a_remedy_that_works(monkeypatch):
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_function(cone, BOUNDS, smoothing=0.001)
    text = one_line(caught)
    assert "smoothing=0.001 needs 80001 samples" in text
    assert "4097" in text
    monkeypatch.setattr("terrapath.surface.fitting.MOST_SAMPLES", 513)
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_function(cone, BOUNDS, smoothing=0.001)
    remedy = float(str(caught.value).split("raise it to ")[1].split(",")[0])
    assert tp.Surface.from_function(cone, BOUNDS, smoothing=remedy).fit.smoothing.scale == remedy


def test_a_function_that_is_not_finite_cannot_be_smoothed():
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_function(lambda x, y: np.where(x == 0.0, np.inf, x), BOUNDS, smoothing=1.0)
    assert "x1=0" in one_line(caught)


def test_the_error_for_a_function_with_an_edge_names_smoothing(monkeypatch):
    monkeypatch.setattr("terrapath.surface.fitting.MOST_SAMPLES", 65)
    with pytest.raises(tp.FitError) as caught:
        tp.Surface.from_function(cone, BOUNDS, 1e-4)
    assert "smoothing=SCALE" in one_line(caught)


# Shortest paths converge to those of the sharp surface

SHARP = {"cone": nonsmooth.cone, "pyramid": nonsmooth.pyramid, "step": nonsmooth.step}
SCALES = (0.4, 0.2, 0.1)


@cache
def rows(name):
    return nonsmooth.smoothing_convergence([SHARP[name]()], SCALES)


def order(name, what):
    return nonsmooth.observed_order(SCALES, [getattr(row, what) for row in rows(name)])


def lifted_length(sharp, count):
    """Length of the polyline in R^3 through points of the true path on the sharp surface."""
    points = sharp.true_path(np.linspace(0.0, 1.0, count))
    heights = sharp.height(*points.T)
    return np.linalg.norm(np.diff(np.column_stack([points, heights]), axis=0), axis=1).sum()


point = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)).filter(lambda p: math.hypot(*p) > 0.1)


@pytest.mark.parametrize("make", [nonsmooth.cone, nonsmooth.pyramid])
@given(start=point, goal=point, slope=st.floats(0.0, 3.0))
@settings(deadline=None, max_examples=60)
def test_the_unrolled_line_is_a_curve_of_its_length_from_start_to_goal(make, start, goal, slope):
    sharp = make(start, goal, slope=slope)
    ends = sharp.true_path(np.array([0.0, 1.0]))
    np.testing.assert_allclose(ends, [start, goal], atol=1e-12)
    # Each edge that a chord cuts off costs less than one chord of 3000.
    lifted = lifted_length(sharp, 3001)
    assert lifted <= sharp.true_length + 1e-9
    assert lifted == pytest.approx(sharp.true_length, rel=1e-3, abs=1e-9)
    back = make(goal, start, slope=slope)
    assert back.true_length == pytest.approx(sharp.true_length, rel=1e-12, abs=1e-12)


@given(start=point, goal=point, slope=st.floats(0.0, 3.0))
@settings(deadline=None, max_examples=60)
def test_no_path_over_a_pyramids_edges_is_shorter_than_the_unrolled_line(start, goal, slope):
    sharp = nonsmooth.pyramid(start, goal, slope=slope)

    def lift(points):
        points = np.asarray(points, float)
        return np.column_stack([points, sharp.height(*points.T)])

    # Every way round, with the crossings of the diagonals on a grid of distances.
    ends, distances = lift([start, goal]), np.linspace(0.0, 5.0, 401)
    corners = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    edges = [lift(distances[:, None] * np.array(corner)) for corner in corners]
    first, last = (round(math.atan2(p[1], p[0]) / (0.5 * math.pi)) % 4 for p in (start, goal))
    found = []
    for way in (1, -1):
        reached, face, before = np.zeros(1), first, ends[:1]
        while face != last:
            edge = edges[face if way == 1 else (face - 1) % 4]
            steps = np.linalg.norm(before[:, None] - edge[None], axis=-1)
            reached, before, face = (reached[:, None] + steps).min(axis=0), edge, (face + way) % 4
        found.append((reached + np.linalg.norm(before - ends[1], axis=1)).min())
    assert sharp.true_length <= min(found) + 1e-12
    assert min(found) == pytest.approx(sharp.true_length, abs=0.04)


def test_the_step_is_as_long_as_its_unrolled_strip():
    sharp = nonsmooth.step((-3, -2), (3, 2), height=2.0)
    assert sharp.true_length == pytest.approx(math.hypot(6.0 + 2.0, 4.0), rel=1e-15)
    on_cliff = sharp.true_path(np.linspace(0.0, 1.0, 801))
    assert np.sum(on_cliff[:, 0] == 0.0) == pytest.approx(801 * 2.0 / 8.0, abs=2)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    # A geodesic misses the cone's apex, where the change is sigma^2/2 times the Laplacian; it
    # crosses the pyramid's edges, where the change is of first order. A cliff's foot and top
    # are rounded over sigma sqrt(log(1/sigma)): the order creeps up to 1 from below.
    [("cone", 1.95, 2.1), ("pyramid", 0.98, 1.02), ("step", 0.6, 0.7)],
)
def test_path_lengths_converge_to_the_sharp_surfaces(name, low, high):
    errors = [row.relative_error for row in rows(name)]
    assert all(error < 0.0 for error in errors)  # a smoothed edge is a shorter way
    assert low < order(name, "relative_error") < high
    assert abs(errors[-1]) < {"cone": 2e-4, "pyramid": 8e-3, "step": 0.05}[name]


@pytest.mark.parametrize(
    ("name", "largest", "rms"), [("cone", 1.0, 1.9), ("pyramid", 1.0, 1.5), ("step", 0.0, 0.5)]
)
def test_the_change_shrinks_with_the_scale_at_the_expected_order(name, largest, rms):
    assert order(name, "largest_change") == pytest.approx(largest, abs=0.03)
    assert order(name, "rms_change") == pytest.approx(rms, abs=0.05)


@pytest.mark.parametrize("k", range(len(SCALES)))
def test_the_path_over_a_smoothed_cliff_has_the_length_of_the_unrolled_cylinder(k):
    # The smoothed cliff z = 2 Phi(x/scale) is a cylinder, which unrolls too.
    scale = SCALES[k]

    def speed(x):
        return math.hypot(
            1.0, 2.0 / scale * math.exp(-0.5 * (x / scale) ** 2) / math.sqrt(math.tau)
        )

    profile = 2.0 * quad(speed, 0.0, 3.0, points=[scale, 3.0 * scale, 6.0 * scale])[0]
    row = rows("step")[k]
    exact = math.hypot(profile, 4.0)
    assert row.length == pytest.approx(exact, rel=1e-4)
    assert abs(row.length - exact) < 0.01 * abs(row.length - row.true_length)


@pytest.mark.parametrize("name", SHARP)
def test_rrt_star_finds_no_shorter_path_and_none_much_longer(name):
    sharp = SHARP[name]()
    surface = tp.Surface.from_function(sharp.height, nonsmooth.REGION, smoothing=0.2)
    start, goal = sharp.true_path(np.array([0.0, 1.0]))
    solution = tp.RRTStar(samples=10_000).solve(tp.Problem(surface, start, goal))
    shortest = rows(name)[SCALES.index(0.2)].length
    assert shortest <= solution.length < 1.01 * shortest


def test_observed_order_is_the_exponent_of_a_power():
    assert nonsmooth.observed_order((1.0, 0.5, 0.1), (3.0, 3.0 / 8, 3e-3)) == pytest.approx(3.0)


# Heights that are rounded


def rounded_terrain(step, cell, *, count=400, seed=0):
    """(true heights, rounded ones): hills of some 60 cells."""
    random = np.random.default_rng(seed)
    x = np.arange(count) * cell
    waves = random.uniform(-1.0, 1.0, (12, 2)) * 2.0 * np.pi / (60.0 * cell)
    phases = random.uniform(0.0, 2.0 * np.pi, 12)
    y = x[:, None]
    hills = [np.sin(a * x + b * y + p) for (a, b), p in zip(waves, phases, strict=True)]
    heights = 4.0 * step * np.sum(hills, axis=0)
    return heights, np.round(heights / step) * step


@pytest.mark.parametrize("scale", [1.5, 2.5, 4.0])
def test_the_slope_error_of_white_rounding_is_the_formulas(scale):
    # Uniform noise of the width of a step, as rounding leaves it where the ground is not level.
    step, cell, count = 0.7, 2.0, 500
    noise = np.random.default_rng(1).uniform(-0.5 * step, 0.5 * step, (count, count))
    x = cell * np.arange(count)
    surface = tp.Surface.from_grid(noise, x, x, smoothing=scale * cell)
    points = points_in((60.0, 60.0, 940.0, 940.0), 40_000)
    found = np.sqrt(np.square(surface.gradients(points)[:, 0]).mean())
    expected = step / math.sqrt(12.0) * cell / ((scale * cell) ** 2 * math.sqrt(8.0 * math.pi))
    assert found == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(("step", "cell"), [(1.0, 1.0), (0.1, 0.5), (1.0, 10.0)])
def test_the_default_scale_brings_the_slope_error_of_rounding_to_a_percent(step, cell):
    true, rounded = rounded_terrain(step, cell)
    scale = scale_for_step(step, cell)
    assert scale == pytest.approx(math.sqrt(5.7583 * step * cell), rel=1e-4)
    x = cell * np.arange(len(true))
    exact = tp.Surface.from_grid(true, x, x)
    raw, smoothed = (tp.Surface.from_grid(rounded, x, x, smoothing=s) for s in (None, scale))
    inside = (20.0 * cell, 20.0 * cell, 379.0 * cell, 379.0 * cell)
    points = points_in(inside, 20_000)
    wanted = exact.gradients(points)[:, 0]
    off = {
        name: np.sqrt(np.square(surface.gradients(points)[:, 0] - wanted).mean())
        for name, surface in (("raw", raw), ("smoothed", smoothed))
    }
    # Rounding is not quite white, and hills are smoothed too.
    assert off["smoothed"] < 0.03
    assert off["raw"] > 3.0 * off["smoothed"]


def test_the_scale_is_none_on_coarse_cells_and_a_few_cells_on_fine_ones():
    assert scale_for_step(1.0, 1.0) == pytest.approx(2.4, abs=0.01)
    assert scale_for_step(1.0, 80.0) == 0.0  # a slope of 1 % is 0.8 m a cell
    assert scale_for_step(1.0, 30.0) == 0.0


@given(
    step=st.sampled_from([1.0, 0.1, 0.25, 0.3048, 2.0, 0.01]),
    offset=st.floats(-1000.0, 3000.0),
    single=st.booleans(),
    seed=seeds,
)
@settings(deadline=None, max_examples=60)
def test_the_step_of_rounded_heights_is_found(step, offset, single, seed):
    random = np.random.default_rng(seed)
    heights = offset + step * random.integers(0, 400, (60, 50))
    heights = heights.astype(np.float32).astype(float) if single else heights
    heights[random.random(heights.shape) < 0.1] = np.nan
    assert quantisation_step(heights) == pytest.approx(step, rel=1e-3)


@given(seeds, st.floats(0.1, 1000.0), st.booleans())
@settings(deadline=None, max_examples=60)
def test_heights_that_are_not_rounded_have_no_step(seed, spread, single):
    heights = np.random.default_rng(seed).normal(scale=spread, size=(60, 50)) + 500.0
    heights = heights.astype(np.float32).astype(float) if single else heights
    assert quantisation_step(heights) == 0.0


def test_too_few_levels_tell_no_step():
    block = np.zeros((40, 40))
    block[10:20, 10:20] = 10.0
    assert quantisation_step(block) == 0.0
    assert quantisation_step(np.full((5, 5), np.nan)) == 0.0
    undeclared = np.random.default_rng(0).normal(size=(40, 40))
    undeclared[3, 3] = -3.4e38  # a no-data value that nobody declared leaves two levels
    assert quantisation_step(undeclared) == 0.0
