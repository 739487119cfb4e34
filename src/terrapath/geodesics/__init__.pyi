from .rays import (
    Geodesic as Geodesic,
)
from .rays import (
    Miss as Miss,
)
from .rays import (
    Ray as Ray,
)
from .rays import (
    christoffel_symbols as christoffel_symbols,
)
from .rays import (
    closest_approach as closest_approach,
)
from .rays import (
    exponential_map as exponential_map,
)
from .rays import (
    gaussian_curvature as gaussian_curvature,
)
from .rays import (
    geodesic_acceleration as geodesic_acceleration,
)
from .rays import (
    hit as hit,
)
from .rays import (
    is_bracket as is_bracket,
)
from .rays import (
    trace_ray as trace_ray,
)
