from .rays import (
    Geodesic as Geodesic,
    Miss as Miss,
    Ray as Ray,
    christoffel_symbols as christoffel_symbols,
    closest_approach as closest_approach,
    exponential_map as exponential_map,
    gaussian_curvature as gaussian_curvature,
    geodesic_acceleration as geodesic_acceleration,
    hit as hit,
    is_bracket as is_bracket,
    trace_ray as trace_ray,
)
