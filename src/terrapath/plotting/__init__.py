"""Floor 6: figures."""

from .figure import draw_field, draw_profile, draw_route, plot_field, plot_profile, plot_route
from .page import draw_page, plot_page

__all__ = [
    "draw_field",
    "draw_page",
    "draw_profile",
    "draw_route",
    "plot_field",
    "plot_page",
    "plot_profile",
    "plot_route",
]
