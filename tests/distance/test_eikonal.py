"""The eikonal equation: stencils, the scheme against a plain heap, orders."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import terrapath as tp
from common import fitted_order
from terrapath.distance.eikonal import Eikonal, model_source
from terrapath.surface.bounds import Bounds


def constant(tensor, lattice):
    """The same metric (h11, h12, h22) at all nodes."""
    return np.broadcast_to(np.asarray(tensor, float), (lattice.ny, lattice.nx, 3)).copy()


def norm(tensor, offsets):
    """|offsets|_h for h = (h11, h12, h22)."""
    x, y = np.moveaxis(np.asarray(offsets), -1, 0)
    h11, h12, h22 = np.moveaxis(np.asarray(tensor), -1, 0)
    return np.sqrt(h11 * x * x + 2.0 * h12 * x * y + h22 * y * y)


# Stencils


def vectors_and_weights(medium, node):
    """Selling's three vectors and weights of a node."""
    record = medium.nodes[node]
    e0 = np.array([record.x0, record.y0], int)
    e1 = np.array([record.x1, record.y1], int)
    weights = np.array([record.rho0, record.rho1, record.rho2], float)
    return [e0, e1, -e0 - e1], weights


@settings(deadline=None, max_examples=150)
@given(ratio=st.floats(0.0, 2.0), angle=st.floats(0.0, math.pi), size=st.floats(0.1, 10.0))
def test_stencils_decompose_the_inverse_metric(ratio, angle, size):
    slope = 10.0**ratio  # anisotropy of lengths, up to that of a slope of 100
    axis = np.array([math.cos(angle), math.sin(angle)])
    h = size * (np.eye(2) + (slope**2 - 1.0) * np.outer(axis, axis))
    lattice = tp.Lattice(Bounds(0.0, 0.0, 4.0, 4.0), 5, 5)
    medium = Eikonal.of_tensors(constant((h[0, 0], h[0, 1], h[1, 1]), lattice), lattice)
    vectors, weights = vectors_and_weights(medium, 12)
    assert (weights >= 0.0).all()
    assert abs(np.linalg.det([vectors[0], vectors[1]])) == pytest.approx(1.0)  # a basis
    made = sum(w * np.outer(e, e) for w, e in zip(weights, vectors, strict=True))
    expected = np.linalg.inv(h)
    assert made == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


# The scheme, by a heap


def upwind_solution(pairs):
    """The u with sum_k w_k max(0, u - a_k)^2 = 1, term by term."""
    pairs = sorted(pairs)
    u, w, b, c = math.inf, 0.0, 0.0, 0.0
    base = pairs[0][0]
    for a, weight in pairs:
        if u <= a:
            break
        w, b, c = w + weight, b + weight * (a - base), c + weight * (a - base) ** 2
        u = base + (b + math.sqrt(max(b * b - w * (c - 1.0), 0.0))) / w
    return u


def is_smooth(trial, near, far):
    return far < near and near - far <= 2.0 * (trial - near)


AROUND = [(i, j) for j in (-1, 0, 1) for i in (-1, 0, 1) if (i, j) != (0, 0)]


class HeapMarch:
    """First-order values decide the order, second-order ones are kept; no factoring.

    Where the bounds cut a stencil off, the edges to the nodes around count too.
    """

    def __init__(self, medium, model, tensors):
        self.nx, self.ny = medium.lattice.nx, medium.lattice.ny
        self.cell = np.array([medium.lattice.dx, medium.lattice.dy])
        self.tensors = tensors.reshape(-1, 3)
        self.around = [int(node.around) for node in medium.nodes]
        self.stencils = [vectors_and_weights(medium, n) for n in range(self.nx * self.ny)]
        self.u = dict(zip(model.seeds.tolist(), model.seed_values.tolist(), strict=True))
        self.trial, self.heap = {}, []
        for seed in list(self.u):
            self.offer(seed)
        while self.heap:
            value, node = heapq.heappop(self.heap)
            if node not in self.u:
                self.u[node] = min(self.solve(node, value), self.by_edges(node))
                self.offer(node)

    def by_edges(self, node):
        """The least value by way of one edge, as long as under the mean of both ends' norms."""
        best = math.inf
        for k, (i, j) in enumerate(AROUND):
            other = node + j * self.nx + i
            if self.around[node] >> k & 1 and other in self.u:
                lengths = norm(self.tensors[[node, other]], self.cell * (i, j))
                best = min(best, self.u[other] + lengths.mean())
        return best

    def value(self, node, vector, times):
        i, j = node % self.nx + times * vector[0], node // self.nx + times * vector[1]
        inside = 0 <= i < self.nx and 0 <= j < self.ny
        return self.u.get(int(j * self.nx + i), math.inf) if inside else math.inf

    def solve(self, node, trial=None):
        pairs = []
        for vector, weight in zip(*self.stencils[node], strict=True):
            near, sign = min((self.value(node, vector, -1), -1), (self.value(node, vector, 1), 1))
            if weight == 0.0 or near == math.inf:
                continue
            far = self.value(node, vector, 2 * sign)
            if trial is not None and is_smooth(trial, near, far):
                pairs.append(((4.0 * near - far) / 3.0, 2.25 * weight))
            else:
                pairs.append((near, weight))
        return upwind_solution(pairs) if pairs else math.inf

    def offer(self, node):
        for other in set(range(self.nx * self.ny)) - set(self.u):
            offset = np.array(
                [node % self.nx - other % self.nx, node // self.nx - other // self.nx]
            )
            reads = any(
                (offset == v).all() or (offset == -v).all() for v in self.stencils[other][0]
            )
            is_beside = np.abs(offset).max() <= 1 and self.around[other]
            value = self.solve(other) if reads else math.inf
            value = min(value, self.by_edges(other)) if is_beside else value
            if value < self.trial.get(other, math.inf):
                self.trial[other] = value
                heapq.heappush(self.heap, (value, other))

    def values(self):
        flat = [self.u.get(n, math.inf) for n in range(self.nx * self.ny)]
        return np.array(flat).reshape(self.ny, self.nx)


def test_the_kernel_settles_as_a_heap_does():
    random = np.random.default_rng(4)
    lattice = tp.Lattice(Bounds(0.0, 0.0, 1.0, 1.0), 14, 12)
    roots = random.normal(size=(12, 14, 2, 2))
    tensors = np.einsum("...ki,...kj->...ij", roots, roots) + 0.2 * np.eye(2)
    given_tensors = np.stack([tensors[..., 0, 0], tensors[..., 0, 1], tensors[..., 1, 1]], -1)
    medium = Eikonal.of_tensors(given_tensors, lattice)
    model = model_source(
        lattice, (0.4, 0.5), 1.0, lambda p: norm(given_tensors[6, 5], p - [0.4, 0.5])
    )
    # Only the seeds: the oracle knows no factoring.
    model = model._replace(values=np.full_like(model.values, np.nan))
    assert medium.nodes["around"].any()
    expected = HeapMarch(medium, model, given_tensors).values()
    # Weights are kept in single precision, and so are lengths of edges made of them.
    assert medium.march(model) == pytest.approx(expected, rel=1e-8)


# Orders


TENSOR = (1.0, 0.9, 2.6)


def error_on_constant_metric(side, radius):
    """L1 error where factoring ends at a radius, inside which the values are exact."""
    lattice = tp.Lattice(Bounds(-1.0, -1.0, 1.0, 1.0), side + 1, side + 1)
    medium = Eikonal.of_tensors(constant(TENSOR, lattice), lattice)
    source = (0.03, -0.02)

    def distance(points):
        return norm(TENSOR, points - np.asarray(source))

    model = model_source(lattice, source, radius * side / 2.0, distance)
    exact = distance(lattice.points)
    rows, columns = np.nonzero(np.hypot(*np.moveaxis(lattice.points - source, -1, 0)) <= radius)
    seeds = rows * lattice.nx + columns
    nowhere = np.full_like(model.values, np.nan)
    model = model._replace(values=nowhere, seeds=seeds, seed_values=exact[rows, columns])
    return np.abs(medium.march(model) - exact).mean()


def test_second_order_on_a_constant_anisotropic_metric():
    sides = np.array([50, 100, 200, 400])
    errors = [error_on_constant_metric(int(side), 0.3) for side in sides]
    assert 1.5 <= fitted_order(2.0 / sides, errors) <= 2.8


def test_with_factoring_a_constant_metric_is_nearly_exact():
    lattice = tp.Lattice(Bounds(-1.0, -1.0, 1.0, 1.0), 61, 61)
    medium = Eikonal.of_tensors(constant(TENSOR, lattice), lattice)
    model = model_source(lattice, (0.03, -0.02), 100.0, lambda p: norm(TENSOR, p - [0.03, -0.02]))
    exact = norm(TENSOR, lattice.points - [0.03, -0.02])
    # But for directions in which both neighbours are farther, and those off the lattice.
    error = np.abs(medium.march(model) / exact - 1.0)
    assert np.median(error) <= 1e-4
    assert error.max() <= 3e-3


def test_the_riemannian_test_of_the_high_accuracy_notebook():
    """Section 2 there: L1 1.2e-4 (Eulerian), 8.8e-5 (semi-Lagrangian) at second order."""

    def tensors(points):
        c = 0.5 * math.pi * np.cos(math.pi * points[..., 0])
        return np.stack([0.25 + c * c, c, np.ones_like(c)], axis=-1)

    def exact(points):
        x, y = points[..., 0], points[..., 1]
        return np.hypot(0.5 * x, y + 0.5 * np.sin(math.pi * x))

    def model_distance(points):  # the mean of the metrics at both ends
        return 0.5 * (norm(tensors(np.zeros(2)), points) + norm(tensors(points), points))

    half = 0.005
    lattice = tp.Lattice(Bounds(-1.0 + half, -0.5 + half, 1.0 - half, 0.5 - half), 200, 100)
    medium = Eikonal.of_tensors(tensors(lattice.points), lattice)
    model = model_source(lattice, (0.0, 0.0), 30.0, model_distance)
    points = lattice.points
    error = np.abs(medium.march(model) - exact(points))
    error[np.abs(points[..., 0] - points[..., 1]) >= 1.0] = 0.0
    assert error.mean() <= 2e-4
