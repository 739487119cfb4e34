"""Optional packages: only some parts of Terrapath need them, and pip installs them as extras."""

from __future__ import annotations

from importlib.util import find_spec

from ..errors import MissingExtraError

# Each package, and the extra of Terrapath that installs it.
EXTRA_OF = {
    "pyogrio": "vector",
    "xarray": "xarray",
    "h5netcdf": "xarray",
    "h5py": "xarray",
    "sympy": "expressions",
    "plotly": "page",
    "gpxpy": "gpx",
    "rosbags": "ros",
    "ruamel.yaml": "robots",
    "laspy": "points",
    "lazrs": "points",
    "plyfile": "points",
}


def require_packages(wanted: str, *packages: str) -> None:
    """Raise MissingExtraError where one of the optional packages is not installed.

    wanted : what needs the packages; the subject of the message. Nothing is imported, so this
    check is quick and can come before a long computation.
    """
    for package in packages:
        if find_spec(package) is None:
            raise MissingExtraError(
                f"{wanted} needs the package {package}, which is not installed: "
                f"pip install 'terrapath[{EXTRA_OF[package]}]'"
            )
