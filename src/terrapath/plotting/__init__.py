"""Floor 6: figures."""

from .figure import draw_route, plot_route

__all__ = ["draw_route", "plot_route"]
