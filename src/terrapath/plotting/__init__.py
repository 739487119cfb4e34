"""Floor 6: figures."""

from .figure import draw_field, draw_route, plot_field, plot_route

__all__ = ["draw_field", "draw_route", "plot_field", "plot_route"]
