"""Floor 6: maps in, routes and distance fields out."""

from .fields import write_field
from .maps import LayerSource, read_surface
from .routes import route_record, write_route

__all__ = ["LayerSource", "read_surface", "route_record", "write_field", "write_route"]
