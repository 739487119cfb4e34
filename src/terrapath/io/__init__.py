"""Floor 6: maps and obstacles in, routes and distance fields out."""

from .fields import write_field
from .maps import LayerSource, read_surface
from .routes import route_record, write_route
from .vectors import RepairedWarning, VectorWarning, read_area, read_obstacles

__all__ = [
    "LayerSource",
    "RepairedWarning",
    "VectorWarning",
    "read_area",
    "read_obstacles",
    "read_surface",
    "route_record",
    "write_field",
    "write_route",
]
