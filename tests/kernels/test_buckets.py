"""The bucket grid against a plain search through all points."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from oracles import nearest_by_force, within_by_force
from terrapath._kernels.planners import buckets as kernels
from terrapath._kernels.planners.tree import CANDIDATE

X0, Y0, WIDTH, HEIGHT = -3.0, 2.0, 8.0, 4.0


def points_at(x, y):
    """Rows with x and y, and with what the search does not read."""
    return np.column_stack([x, y, np.full(len(x), np.nan)])


def lay_out(buckets, points, count, side, width=WIDTH, height=HEIGHT):
    """Lay out the first points, and put them in their order; put the others in one by one."""
    numbers = np.full(len(points), -9, np.int32)
    kernels.resize(buckets, width, height, side)
    kernels.lay_out(buckets, points, count, numbers)
    assert numbers[0] == 0
    assert sorted(numbers[:count]) == list(range(count))
    points[numbers[:count]] = points[:count].copy()
    for p in range(count, len(points)):
        kernels.put(buckets, points, p)


def make(x, y, side, count=None, room=64, frame=(X0, Y0, WIDTH, HEIGHT)):
    """Buckets with the first ``count`` points laid out, and the others put in one by one."""
    x0, y0, width, height = frame
    points = points_at(x, y)
    buckets = kernels.Buckets(
        first=np.full(room + 1, -3, np.int32),
        head=np.full(room, -5, np.int32),
        next=np.full(len(x), -7, np.int32),  # no list may be followed into an old one
        frame=np.array([x0, y0, 0.0]),
        shape=np.zeros(2, np.int64),
    )
    lay_out(buckets, points, len(x) if count is None else count, side, width, height)
    return buckets, points


def found_within(buckets, points, at, radius):
    found = np.zeros(len(points) + 1, CANDIDATE)
    count = kernels.within(buckets, points, at[0], at[1], radius, found)
    listed = found["vertex"][:count].tolist()
    assert len(set(listed)) == len(listed)
    squared = ((points[listed, :2] - at) ** 2).sum(axis=1)
    np.testing.assert_allclose(found["squared"][:count], squared, rtol=1e-12)
    return set(listed)


def check(buckets, points, places, radii):
    x, y = points[:, 0], points[:, 1]
    for at in places:
        expected = nearest_by_force(x, y, at)
        assert kernels.nearest(buckets, points, at[0], at[1]) == expected
        for radius in radii:
            expected = within_by_force(x, y, at, radius)
            assert found_within(buckets, points, at, radius) == expected


def spread(kind, count, random):
    unit = random.uniform(size=(count, 2))
    if kind == "clustered":
        unit = 0.73 + 0.001 * unit
    elif kind == "border":
        edge = random.integers(0, 4, count)
        unit[edge == 0, 0], unit[edge == 1, 0] = 0.0, 1.0
        unit[edge == 2, 1], unit[edge == 3, 1] = 0.0, 1.0
    elif kind == "lattice":  # many ties
        unit = np.round(unit * 8) / 8
    return X0 + WIDTH * unit[:, 0], Y0 + HEIGHT * unit[:, 1]


@pytest.mark.parametrize("kind", ["uniform", "clustered", "border", "lattice"])
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 120),
    side=st.floats(0.01, 20.0),
    room=st.integers(2, 300),
)
@settings(deadline=None, max_examples=40)
def test_nearest_and_within_find_what_a_search_through_all_finds(kind, seed, count, side, room):
    random = np.random.default_rng(seed)
    x, y = spread(kind, count, random)
    laid_out = int(random.integers(1, count + 1))
    buckets, points = make(x, y, side, laid_out, room)
    places = [*np.column_stack(spread(random.choice(["uniform", kind]), 6, random)), (x[0], y[0])]
    radii = [0.0, 0.3, 1.0, 2.5, 20.0]
    check(buckets, points, places, radii)
    # Laid out anew, coarser or finer, the same is found.
    lay_out(buckets, points, count, side * random.uniform(0.1, 3.0))
    check(buckets, points, places, radii)


@given(seed=st.integers(0, 2**32 - 1), side=st.floats(0.05, 3.0))
@settings(deadline=None, max_examples=40)
def test_places_beyond_the_border_are_answered_too(seed, side):
    random = np.random.default_rng(seed)
    x, y = spread("uniform", 40, random)
    buckets, points = make(x, y, side)
    places = random.uniform((X0 - 5, Y0 - 5), (X0 + WIDTH + 5, Y0 + HEIGHT + 5), (10, 2))
    for at in places:
        expected = within_by_force(points[:, 0], points[:, 1], at, 4.0)
        assert found_within(buckets, points, at, 4.0) == expected


@given(
    width=st.floats(1e-3, 1e6),
    height=st.floats(1e-3, 1e6),
    side=st.floats(1e-6, 1e7),
    room=st.integers(2, 500),
)
@settings(deadline=None, max_examples=150)
def test_the_buckets_never_outgrow_their_room_and_are_never_finer_than_asked(
    width, height, side, room
):
    x, y = np.array([X0, X0 + width, X0]), np.array([Y0, Y0 + height, Y0 + height])
    buckets, points = make(x, y, side, room=room, frame=(X0, Y0, width, height))
    columns, rows = buckets.shape
    assert 1 <= columns * rows <= room
    assert buckets.frame[2] >= side
    first = buckets.first[: columns * rows + 1]
    assert first[0] == 1  # the very first point is a later one of its bucket
    assert first[-1] == len(points)
    assert (np.diff(first) >= 0).all()
    heads = buckets.head[: columns * rows]
    assert heads.max() == 0
    assert (heads >= 0).sum() == 1
    for cell in range(columns * rows):
        for p in range(first[cell], first[cell + 1]):
            column, row = (
                kernels.column_of(buckets, points[p, 0]),
                kernels.row_of(buckets, points[p, 1]),
            )
            assert row * columns + column == cell


def test_of_several_nearest_points_the_first_is_found():
    x, y = np.array([1.0, 0.0, 0.0, 1.0]), np.array([3.0, 3.0, 3.0, 3.0])
    for count in range(1, 3):  # more would be numbered anew
        buckets, points = make(x, y, 0.5, count)
        assert kernels.nearest(buckets, points, 0.5, 3.0) == 0
        assert kernels.nearest(buckets, points, 0.1, 3.0) == 1


def test_a_point_at_the_radius_is_within_it():
    buckets, points = make(np.array([0.0, 1.0]), np.array([3.0, 3.0]), 0.25)
    assert found_within(buckets, points, (0.0, 3.0), 1.0) == {0, 1}
    assert found_within(buckets, points, (0.0, 3.0), np.nextafter(1.0, 0.0)) == {0}
