from .figure import (
    draw_field as draw_field,
    draw_profile as draw_profile,
    draw_route as draw_route,
    draw_travel as draw_travel,
    plot_field as plot_field,
    plot_profile as plot_profile,
    plot_route as plot_route,
    plot_travel as plot_travel,
)
from .page import draw_page as draw_page, plot_page as plot_page
