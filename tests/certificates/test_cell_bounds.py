"""Lower bounds where costs are constant in cells: piecewise linear potentials and their proofs."""

import math

import numpy as np
import pytest
import shapely

import terrapath as tp
from certificate_cases import nudged, resealed
from certificate_oracles import dual_norm_squared
from cost_rasters import CELL, Walker, cell_surface, random_costs, random_heights
from terrapath._kernels.certificates import flow as flow_kernels, norms
from terrapath._kernels.certificates.potentials import Potential, linear_value
from terrapath._kernels.certificates.surface_models import Box
from terrapath.certificates.certificate import certify
from terrapath.certificates.claims import Claim, Core, cell_needs
from terrapath.certificates.multigrid import Multigrid
from terrapath.certificates.search import certificates
from terrapath.errors import CertificateError
from terrapath.space.lattice import Lattice
from terrapath.surface import Mask
from terrapath.surface.bounds import Bounds


def problem_of(seed, count=24, steep=0.0, **options):
    random, axis = np.random.default_rng(seed), CELL * np.arange(count)
    costs, heights = random_costs(random, count), random_heights(random, count, steep)
    top = axis[-1]
    return (
        tp.Problem(cell_surface(costs, heights), (12.0, 17.0), (top - 14.0, top - 21.0), **options),
        Walker(costs, heights, axis, axis),
    )


def blocked_cells(columns):
    """Columns of a grid of 20 x 20 cells that may not be entered."""
    axis, blocked = 10.0 * np.arange(20), np.zeros((20, 20), bool)
    blocked[:, columns] = True
    return Mask(blocked, axis, axis)


def interpolated(values, s, t):
    """The piecewise linear function through values (ny, nx) at (s, t), and its slopes, in cells."""
    i, j = min(int(s), values.shape[1] - 2), min(int(t), values.shape[0] - 2)
    a, b, c, d = values[j, i], values[j, i + 1], values[j + 1, i], values[j + 1, i + 1]
    rising = [(b - a, d - b), (d - c, c - a)]
    falling = [(b - a, c - a), (d - c, d - b)]
    s, t = s - i, t - j
    if max(np.hypot(*g) for g in rising) < max(np.hypot(*g) for g in falling):
        slope = rising[0] if t <= s else rising[1]
        return a + s * slope[0] + t * slope[1], slope
    if s + t <= 1.0:
        return a + s * falling[0][0] + t * falling[0][1], falling[0]
    return d - (1.0 - s) * falling[1][0] - (1.0 - t) * falling[1][1], falling[1]


def test_what_a_search_found_before_it_had_to_stop_is_proven():
    problem, _ = problem_of(0)
    looks = iter(range(60))
    stopped = certificates(problem, must_stop=lambda: next(looks, None) is None)
    (found,) = stopped
    assert next(looks, None) is None  # it was stopped
    whole = tp.lower_bound(problem).value
    chord = float(tp.chord(problem.surface, problem.start, problem.goal))
    assert chord * 1.2 < found.value <= whole * (1.0 + 1e-3)


@pytest.mark.parametrize("steep", [0.0, 1.0])
def test_the_facts_of_a_box_hold_at_all_its_points(steep):
    problem, walker = problem_of(3, steep=steep)
    surface, random = problem.surface, np.random.default_rng(8)
    values = random.normal(0.0, 30.0, (12, 12))
    potential = Potential(np.pad(values, 1, mode="edge"), 25.0, 25.0, 5.0, 5.0, True)
    goal = surface.lift(np.array(problem.goal))
    for _ in range(200):
        i, j = random.integers(0, 11, 2)
        low, high = np.sort(random.uniform(0.0, 1.0, (2, 2)), axis=0)
        x0, x1 = 25.0 + 5.0 * (i + low[0]), 25.0 + 5.0 * (i + high[0])
        y0, y1 = 25.0 + 5.0 * (j + low[1]), 25.0 + 5.0 * (j + high[1])
        box = Box(0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0))
        work = np.empty((2, 11))
        facts = norms.facts_of_box(surface.data, potential, goal, i, j, box, work)
        for x, y in random.uniform((x0, y0), (x1, y1), (9, 2)):
            u, slope = interpolated(values, (x - 25.0) / 5.0, (y - 25.0) / 5.0)
            assert linear_value(potential, x, y) == pytest.approx(u, abs=1e-9)
            assert facts.lowest <= u + 1e-9
            du = np.array(slope) / 5.0
            gradients = surface.gradients((x, y))[:, None]
            cost = walker.costs[round(y / CELL), round(x / CELL)]
            (norm,) = dual_norm_squared(du[None], gradients[:1]) / cost**2
            assert facts.norm >= norm * (1.0 - 1e-9)


@pytest.mark.parametrize(("seed", "steep"), [(0, 0.0), (1, 0.0), (2, 0.6), (3, 1.5)])
def test_no_path_is_shorter_than_the_bound(seed, steep):
    problem, walker = problem_of(seed, steep=steep)
    solution = tp.plan(problem, "a-star", neighbours=32, spacing=CELL / 2.0, refine=True)
    bound = tp.lower_bound(problem, length=solution.length, target_gap=0.005)
    assert bound.value <= walker.length(solution.path.points) * (1.0 + 1e-9)
    if steep == 0.0:
        assert solution.length <= 1.01 * bound.value
    bound.check(problem)


def test_the_bound_is_near_where_much_of_the_cost_is_beside_the_goal():
    # A third of it, in one cell of 148; ground of 1 leads there.
    costs = random_costs(np.random.default_rng(15), 40)
    problem = tp.Problem(cell_surface(costs), (30.0, 34.0), (361.0, 347.0))
    bound = tp.lower_bound(problem, length=772.7794081297905, target_gap=1e-3)
    assert bound.value >= 772.0
    bound.check(problem)


@pytest.mark.parametrize("shape", [(2, 2), (3, 8), (17, 33), (40, 26)])
def test_a_multigrid_cycle_is_nearly_the_inverse(shape):
    random = np.random.default_rng(1)
    weights = 10.0 ** random.uniform(-3.0, 0.0, (shape[0] - 1, shape[1] - 1))
    cycle = Multigrid(weights, 1.0, 4.0)
    x, y = (np.pad(weights, pad) for pad in (((1, 1), (0, 0)), ((0, 0), (1, 1))))

    def operator(u):
        """The gradient of half the energy: each half of a cell has a slope along each axis."""
        result = np.zeros_like(u)
        for axis, links in ((1, x[:-1] + x[1:]), (0, 4.0 * (y[:, :-1] + y[:, 1:]))):
            pull = links * np.diff(u, axis=axis)
            result -= np.diff(pull, axis=axis, prepend=0.0, append=0.0)
        return result

    b, other = (random.standard_normal(shape) for _ in range(2))
    b, other = b - b.mean(), other - other.mean()
    there = (cycle.solve(b) * other).sum()
    assert (cycle.solve(other) * b).sum() == pytest.approx(there, rel=1e-9)
    error = random.standard_normal(shape)
    for _ in range(10):
        before = (error * operator(error)).sum()
        left = error - cycle.solve(operator(error))
        # No eigenvalue is above 1, or the method that is preconditioned may diverge.
        assert (left * operator(error)).sum() * (1.0 + 1e-9) + 1e-12 * before >= 0.0
        assert (left * operator(left)).sum() <= 0.81 * before + 1e-24
        error = left


def test_a_finer_lattice_begins_with_the_same_function():
    random = np.random.default_rng(2)
    u, flow = random.standard_normal((5, 7)), random.standard_normal((4, 6, 2, 2))
    rising = np.zeros((4, 6), bool)
    flow_kernels.choose_diagonals(u, 1.0, rising)
    finer, finer_flow = np.empty((9, 13)), np.empty((8, 12, 2, 2))
    flow_kernels.refine(u, flow, rising, finer, finer_flow)
    for t in range(9):
        for s in range(13):
            assert finer[t, s] == pytest.approx(interpolated(u, s / 2.0, t / 2.0)[0], abs=1e-12)
    # It carries as much from the start to the goal, too.
    sources = []
    for values, sent in ((u, flow), (finer, finer_flow)):
        cells, roots = np.zeros(sent.shape[:2], bool), np.zeros((*sent.shape[:2], 3))
        roots[..., [0, 2]] = 1.0
        flow_kernels.choose_diagonals(values, 1.0, cells)
        sources.append(np.empty_like(values))
        flow_kernels.fill_sources(sent, roots, cells, sources[-1])
    assert (sources[0] * u).sum() == pytest.approx((sources[1] * finer).sum(), rel=1e-12)


def test_bounds_that_cut_cells_and_obstacles_are_proven_with():
    obstacles = [shapely.box(70.0, 60.0, 110.0, 183.0)]
    problem, _ = problem_of(4, bounds=(3.0, 8.0, 223.0, 219.0), obstacles=obstacles)
    solution = tp.plan(problem, "optimal", target_gap=0.04)
    assert solution.gap <= 0.05
    assert solution.certificate is not None
    solution.certificate.check(problem)


def shunned(**options):
    """Cheap cells behind a side at x = 145."""
    costs = np.full((20, 20), 50.0)
    costs[:, 15] = 1.0
    return tp.Problem(cell_surface(costs), (100.0, 20.0), (100.0, 150.0), **options)


def path_along(problem, x):
    return problem.path([(100.0, 20.0), (x, 20.0), (x, 150.0), (100.0, 150.0)])


BESIDE = 145.0 - 1e-7


@pytest.mark.parametrize(
    ("options", "x"),
    [
        ({"bounds": (40.0, 0.0, 145.0, 190.0)}, 145.0),
        ({"bounds": (40.0, 0.0, BESIDE, 190.0)}, BESIDE),
        ({"obstacles": [shapely.box(145.0, -10.0, 155.0, 200.0)]}, BESIDE),
        ({"obstacles": [blocked_cells([15])]}, BESIDE),
    ],
)
def test_cells_that_cannot_be_entered_lend_no_cost_to_their_sides(options, x):
    problem = shunned(**options)
    path = path_along(problem, x)
    assert problem.allows(path)
    assert path.length == pytest.approx(50.0 * (45.0 + 130.0 + 45.0), rel=1e-6)
    straight = 50.0 * 130.0
    bound = tp.lower_bound(problem, length=straight, target_gap=1e-3)
    bound.check(problem)
    assert 0.999 * straight <= bound.value <= straight * (1.0 + 1e-9)
    # What was given stays, and another problem on that surface has it.
    again = shunned()
    opened = tp.Problem(problem.surface, again.start, again.goal)
    assert path_along(opened, x).length == path_along(again, x).length < 5000.0


def test_bounds_hold_for_paths_along_cells_that_lend_their_cost():
    # A part of each cheap cell is open, behind the obstacle.
    problem = shunned(obstacles=[shapely.box(145.0, -10.0, 154.0, 200.0)])
    path = path_along(problem, BESIDE)
    assert problem.allows(path)
    bound = tp.lower_bound(problem, length=6500.0)
    bound.check(problem)
    assert 0.9 * path.length <= bound.value <= path.length * (1.0 + 1e-9)


def test_no_data_lends_no_cost_and_is_no_bridge():
    # Two columns without a cost between dear ground and a cheap lane; a ford far up.
    axis, costs = CELL * np.arange(30), np.full((30, 30), 50.0)
    costs[:, 17], costs[:, 15:17], costs[25:28, 15:17] = 1.0, math.nan, 20.0
    layer = (costs, axis, axis)
    surface = tp.read_surface((np.zeros_like(costs), axis, axis), costs={"going": layer})
    problem = tp.Problem(surface, (20.0, 50.0), (130.0, 230.0))
    along = problem.path([(144.9, 50.0), (144.9, 230.0)])
    assert along.length == pytest.approx(50.0 * 180.0)
    straight = 50.0 * math.hypot(110.0, 180.0)
    bound = tp.lower_bound(problem, length=straight, target_gap=1e-3)
    bound.check(problem)
    assert 0.999 * straight <= bound.value <= straight * (1.0 + 1e-9)


@pytest.mark.parametrize("beside", [1e-8, 0.9e-7, 1.5e-7])
def test_a_lattice_beside_the_sides_of_cells_is_refused(beside):
    # Where u climbs as steeply as the dear cells allow, on a strip of cheap ground.
    axis, costs = np.arange(8) + 0.5, np.ones((8, 8))
    costs[:, 4:] = 1e9
    problem = tp.Problem(cell_surface(costs, x=axis, y=axis), (1.0, 4.0), (4.0 - 0.2 * beside, 4.0))
    lattice = Lattice(Bounds(0.5 - beside, 0.5, 7.5 - beside, 7.5), 15, 15)
    side = 4.0 - beside
    rise = np.where(lattice.x < side + 0.1, lattice.x - 1.0, side - 1.0 + 1e9 * (lattice.x - side))
    claim = Claim(
        value=0.0,
        norm=math.inf,
        coefficients=np.pad(np.tile(rise, (15, 1)), 1, mode="edge"),
        bounds=lattice.bounds,
        horizon=1e9,
        start_core=Core(0, 2, 6, 8),
        goal_core=Core(6, 8, 6, 8),
    )
    with pytest.raises(CertificateError, match="beside"):
        certify(problem, claim, cell_needs(problem, claim, 0.999)).check(problem)


def test_a_forged_bound_is_refused():
    problem, _ = problem_of(5)
    made = tp.lower_bound(problem)
    made.check(problem)
    for change in (
        {"value": 1.01 * made.value},
        {"norm": 0.99 * made.norm},
        {"coefficients": nudged(made, 10, 10, 50.0)},
        {"coefficients": 1.01 * made.coefficients},
    ):
        with pytest.raises(CertificateError):
            resealed(made, **change).check(problem)
    other, _ = problem_of(6)
    with pytest.raises(CertificateError):
        made.check(other)
