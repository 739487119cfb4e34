from . import geodesics as geodesics
from . import scenario as scenario
from ._version import __version__ as __version__
from .certificates.certificate import Certificate as Certificate
from .certificates.search import lower_bound as lower_bound
from .distance.field import DistanceField as DistanceField
from .distance.field import distance_field as distance_field
from .errors import (
    CertificateError as CertificateError,
)
from .errors import (
    FitError as FitError,
)
from .errors import (
    InputError as InputError,
)
from .errors import (
    MapError as MapError,
)
from .errors import (
    MissingExtraError as MissingExtraError,
)
from .errors import (
    OutsideSurfaceError as OutsideSurfaceError,
)
from .errors import (
    TerrapathError as TerrapathError,
)
from .geodesics.alternatives import alternatives as alternatives
from .geodesics.refinement import refine as refine
from .io import (
    LayerSource as LayerSource,
)
from .io import (
    RepairedWarning as RepairedWarning,
)
from .io import (
    VectorWarning as VectorWarning,
)
from .io import (
    read_area as read_area,
)
from .io import (
    read_obstacles as read_obstacles,
)
from .io import (
    read_surface as read_surface,
)
from .io import (
    write_field as write_field,
)
from .io import (
    write_route as write_route,
)
from .planners import (
    RRT as RRT,
)
from .planners import (
    AStar as AStar,
)
from .planners import (
    Dijkstra as Dijkstra,
)
from .planners import (
    FastMarching as FastMarching,
)
from .planners import (
    GeodesicTraversal as GeodesicTraversal,
)
from .planners import (
    Optimal as Optimal,
)
from .planners import (
    Progress as Progress,
)
from .planners import (
    RRTStar as RRTStar,
)
from .planners import (
    plan as plan,
)
from .plotting import (
    plot_field as plot_field,
)
from .plotting import (
    plot_page as plot_page,
)
from .plotting import (
    plot_profile as plot_profile,
)
from .plotting import (
    plot_route as plot_route,
)
from .problem import Path as Path
from .problem import Problem as Problem
from .problem import Solution as Solution
from .problem import Status as Status
from .problem import scenes as scenes
from .space.free_space import Circle as Circle
from .space.free_space import FreeSpace as FreeSpace
from .space.lattice import Lattice as Lattice
from .surface import Layer as Layer
from .surface import Mask as Mask
from .surface import Surface as Surface
from .surface import metric as metric
from .surface.metric import chord as chord
from .surface.metric import curve_length as curve_length
from .surface.metric import line_r as line_r
