from . import geodesics as geodesics, scenario as scenario, travel as travel
from ._version import __version__ as __version__
from .certificates.certificate import Certificate as Certificate
from .certificates.search import lower_bound as lower_bound
from .distance.field import DistanceField as DistanceField, distance_field as distance_field
from .errors import (
    BlockedError as BlockedError,
    CertificateError as CertificateError,
    FitError as FitError,
    GroundWarning as GroundWarning,
    InputError as InputError,
    KernelWarning as KernelWarning,
    MapError as MapError,
    MapWarning as MapWarning,
    MissingExtraError as MissingExtraError,
    OutsideSurfaceError as OutsideSurfaceError,
    RepairedWarning as RepairedWarning,
    SnapWarning as SnapWarning,
    TerrapathError as TerrapathError,
    TerrapathWarning as TerrapathWarning,
    UnfinishedWarning as UnfinishedWarning,
    VectorWarning as VectorWarning,
)
from .geodesics.alternatives import alternatives as alternatives
from .geodesics.refinement import refine as refine
from .io import (
    LayerSource as LayerSource,
    read_area as read_area,
    read_obstacles as read_obstacles,
    read_surface as read_surface,
    write_field as write_field,
    write_route as write_route,
)
from .planners import (
    RRT as RRT,
    AStar as AStar,
    Dijkstra as Dijkstra,
    FastMarching as FastMarching,
    GeodesicTraversal as GeodesicTraversal,
    Optimal as Optimal,
    Progress as Progress,
    RRTStar as RRTStar,
    plan as plan,
)
from .plotting import (
    plot_field as plot_field,
    plot_page as plot_page,
    plot_profile as plot_profile,
    plot_route as plot_route,
    plot_travel as plot_travel,
)
from .problem import (
    Path as Path,
    Problem as Problem,
    Solution as Solution,
    Status as Status,
    scenes as scenes,
)
from .space.free_space import Circle as Circle, FreeSpace as FreeSpace
from .space.lattice import Lattice as Lattice
from .surface import Layer as Layer, Mask as Mask, Surface as Surface, metric as metric
from .surface.metric import chord as chord, curve_length as curve_length, line_r as line_r
