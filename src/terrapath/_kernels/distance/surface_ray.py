"""What straight pieces of a path cost on the surface itself, without samples."""

from ..compiler import kernel
from ..surface.surfaces import (
    floor_of,
    has_cells,
    log_cost_at,
    mean_cell_cost,
    slope_at,
    spot_at,
    squared_cost_at,
)
from ..vec4 import sqrt
from .ground import Costs, bent, flat, mean_cost, plus_rise


@kernel
def surface_piece(surface, ax, ay, bx, by):
    """The cost of a piece between two places, map units."""
    vx, vy = bx - ax, by - ay
    a, b = spot_at(surface, ax, ay), spot_at(surface, bx, by)
    middle = spot_at(surface, ax + 0.5 * vx, ay + 0.5 * vy)
    lift = flat(0.0, vx, vy, -vy, vx)
    for layer in range(surface.weights.shape[0]):
        weight, slope = surface.weights[layer], slope_at(surface, layer, middle)
        z0, z2 = slope_at(surface, layer, a).f, slope_at(surface, layer, b).f
        across = weight * (vx * slope.fy - vy * slope.fx)
        lift = plus_rise(lift, weight * z0, weight * slope.f, weight * z2, across)
    if not lift.vv > 0.0:
        return 0.0
    rise = log_cost_at(surface, ax + 0.5 * vx, ay + 0.5 * vy)
    c = sqrt(squared_cost_at(surface, middle))
    costs = Costs(
        sqrt(squared_cost_at(surface, a)),
        c,
        sqrt(squared_cost_at(surface, b)),
        c * (vx * rise.fy - vy * rise.fx),
    )
    cost = bent(lift) * mean_cost(lift, costs)
    if not has_cells(surface):
        return max(cost, floor_of(surface) * sqrt(lift.vv))
    return max(cost * mean_cell_cost(surface, ax, ay, bx, by), floor_of(surface) * sqrt(lift.vv))


@kernel
def surface_ray(surface, ax, ay, bx, by, count):
    """The cost of the straight line between two places, map units, in so many pieces."""
    cost, vx, vy = 0.0, (bx - ax) / count, (by - ay) / count
    for k in range(count):
        x, y = ax + k * vx, ay + k * vy
        cost += surface_piece(surface, x, y, x + vx, y + vy)
    return cost
