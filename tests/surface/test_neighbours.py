"""Values between cells and grown regions: as SciPy has them."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, map_coordinates

from terrapath.surface.neighbours import bilinear, grown

SHAPES = [(1, 1), (1, 5), (7, 1), (2, 2), (30, 41)]


@pytest.mark.parametrize("shape", SHAPES)
def test_values_between_cells_are_those_of_scipy(shape):
    rng = np.random.default_rng(0)
    values = rng.normal(size=shape) * 10.0 ** rng.uniform(-5.0, 5.0, shape)
    row, column = (rng.uniform(0.0, size - 1.0, 2000) for size in shape)
    row[:100], column[50:150] = np.rint(row[:100]), np.rint(column[50:150])
    found = bilinear(values, row, column)
    assert np.array_equal(found, map_coordinates(values, [row, column], order=1))


@pytest.mark.parametrize("shape", SHAPES)
def test_beyond_the_edge_values_are_those_at_the_edge(shape):
    values = np.random.default_rng(1).normal(size=shape)
    row, column = np.array([-3.0, -0.5, 99.0]), np.array([-0.1, 99.0, 50.0])
    at_edge = np.clip(row, 0, shape[0] - 1), np.clip(column, 0, shape[1] - 1)
    assert np.array_equal(bilinear(values, row, column), bilinear(values, *at_edge))
    assert bilinear(values, row, column)[2] == values[-1, -1]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("share", [0.0, 0.05, 0.5, 1.0])
def test_grown_cells_are_those_of_scipy(shape, share):
    cells = np.random.default_rng(2).random(shape) < share
    before = cells.copy()
    assert np.array_equal(grown(cells), binary_dilation(cells, np.ones((3, 3))))
    assert np.array_equal(cells, before)
