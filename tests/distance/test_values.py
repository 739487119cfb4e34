"""The values of nodes, four at once and one by one."""

import numpy as np
import pytest

import terrapath as tp
from terrapath._kernels.compiler import kernel
from terrapath._kernels.distance import bellman, hopf_lax, quartet, values
from terrapath._kernels.prefetch import fetch
from terrapath.distance import medium as mediums

AXIS = 10.0 * np.arange(40)


@kernel
def fill_values(medium, state, source, nodes, count, found):
    """Fill the values of nodes, so many at once."""
    for first in range(0, nodes.shape[0], count):
        for m in range(count):
            n = nodes[first + m]
            best = np.int64(state.nodes[n].best)
            quartet.place_node(medium, source, state.quartet.nodes[m], n, best)
        four = values.values_of(medium, state, source, state.quartet, count)
        for m in range(count):
            found[first + m] = four[m]


def rough_medium(weight, obstacles):
    random = np.random.default_rng(6)
    heights = random.uniform(0.0, 20.0, (2, 40, 40))
    costs = random.uniform(0.5, 2.0, (40, 40))
    surface = tp.Surface.from_grid(
        np.array([*heights, costs]),
        AXIS,
        AXIS,
        kinds=["rise", "rise", "cost"],
        weights=[weight, 1.0, 1.0],
    )
    problem = tp.Problem(surface, (55.0, 55.0), (300.0, 300.0), obstacles=obstacles)
    lattice = tp.Lattice.spanning(surface.bounds, 6.0)
    return mediums.Medium(surface, lattice, problem.free_space), problem.start


def marched(medium, start, monkeypatch):
    """The state after a march."""
    states, make = [], mediums._state_of
    monkeypatch.setattr(mediums, "_state_of", lambda count: states.append(make(count)) or states[0])
    u, tau = medium.march(start)
    return states[0], u, tau


@pytest.mark.parametrize("weight", [0.1, 3.0])
@pytest.mark.parametrize("obstacles", [[], [tp.Circle(200.0, 150.0, 60.0)]])
def test_four_values_are_those_of_each_node_by_itself(weight, obstacles, monkeypatch):
    medium, start = rough_medium(weight, obstacles)
    state, u, tau = marched(medium, start, monkeypatch)
    source = bellman.Source(
        *medium._place(start),
        mediums.lift_of(medium.surface, start),
        float(medium.surface.cost(np.array(start))),
    )
    nodes = np.flatnonzero((state.nodes["best"] != hopf_lax.SEED) & np.isfinite(tau.ravel()))
    nodes = nodes[: len(nodes) // 12 * 12]
    assert len(nodes) > 3000
    found = np.full((4, len(nodes)), np.nan)
    for count in (1, 2, 3, 4):
        fill_values(medium.data, state, source, nodes, count, found[count - 1])
    assert (found == found[0]).all()
    # What followed from neighbours that were known in time is no less when all of them are known.
    assert np.median(found[0] / u.ravel()[nodes]) == pytest.approx(1.0, abs=1e-9)


def test_values_do_not_depend_on_whether_days_are_in_order(monkeypatch):
    medium, start = rough_medium(1.0, [])
    some = medium.march(start)[0]
    monkeypatch.setattr(mediums, "DAY_SHARE", 0.0)
    ordered = medium.march(start)[0]
    known = ordered > 0.0
    assert np.abs(some[known] / ordered[known] - 1.0).max() < 0.02
    assert np.median(np.abs(some[known] / ordered[known] - 1.0)) < 1e-4


@kernel
def fetch_all(array, places):
    total = 0
    for place in places:
        total += fetch(array, place)
    return total


def test_any_place_may_be_fetched():
    places = np.array([0, 3, -5, 10**12])
    assert fetch_all(np.zeros((2, 2)), places) == places.sum() == fetch(np.zeros(4), places.sum())
