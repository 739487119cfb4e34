from .figure import (
    draw_field as draw_field,
)
from .figure import (
    draw_profile as draw_profile,
)
from .figure import (
    draw_route as draw_route,
)
from .figure import (
    plot_field as plot_field,
)
from .figure import (
    plot_profile as plot_profile,
)
from .figure import (
    plot_route as plot_route,
)
from .page import draw_page as draw_page
from .page import plot_page as plot_page
