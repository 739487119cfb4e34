from .fields import write_field as write_field
from .maps import OpenMap as OpenMap, open_map as open_map, read_surface as read_surface
from .routes import write_route as write_route
from .routes.record import route_record as route_record
from .sources import LayerSource as LayerSource
from .vectors import read_area as read_area, read_obstacles as read_obstacles
