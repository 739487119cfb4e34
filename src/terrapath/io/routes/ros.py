"""A ROS 2 bag with one nav_msgs/Path, for a robot to follow."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...problem import Path as Route, Solution
from ...surface import Surface
from ...validation import Array
from .profile import headings, slopes
from .units import height_metres, plane_metres

TOPIC, FRAME = "/plan", "map"
# The oldest version that the library writes: every ROS 2 since Humble reads it.
BAG_VERSION: Literal[8] = 8
# No date: the same route gives the same bytes, and ROS reads time 0 as "any time".
STAMP = 0


def positions(surface: Surface, route: Route) -> Array:
    """(m, 3): the profile's points in metres; heights without a unit are in the plane's."""
    plane = plane_metres(surface.georeference) or 1.0
    height = height_metres(surface) or plane
    profile = route.profile
    return np.column_stack([plane * profile.points, height * profile.values[:, 0]])


def orientations(route: Route) -> Array:
    """(m, 4): quaternions x, y, z, w of a vehicle that faces along the route, on the ground.

    Yaw is counted from the x axis, anticlockwise; nose up is a negative pitch (REP 103).
    """
    ahead = headings(route.profile.points)
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    pitch = -np.radians(slopes(route).along)
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_euler("ZY", np.column_stack([yaw, pitch]))
    return np.asarray(turned.as_quat(canonical=True))


def _message(solution: Solution, types: Any) -> Any:
    """The nav_msgs/Path."""
    assert solution.path is not None
    point, quaternion, pose, pose_stamped, header, time, path = (
        types[name]
        for name in (
            "geometry_msgs/msg/Point",
            "geometry_msgs/msg/Quaternion",
            "geometry_msgs/msg/Pose",
            "geometry_msgs/msg/PoseStamped",
            "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
            "nav_msgs/msg/Path",
        )
    )
    heading = header(stamp=time(sec=STAMP, nanosec=0), frame_id=FRAME)
    places = positions(solution.problem.surface, solution.path).tolist()
    turns = orientations(solution.path).tolist()
    poses = [
        pose_stamped(heading, pose(point(*place), quaternion(*turn)))
        for place, turn in zip(places, turns, strict=True)
    ]
    return path(heading, poses)


def write(solution: Solution, folder: Path) -> None:
    """Write a bag into a folder that does not exist yet."""
    import sqlite3

    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.rosbag2.errors import WriterError
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    message = _message(solution, store.types)
    kind = message.__msgtype__
    try:
        with Writer(folder, version=BAG_VERSION, storage_plugin=StoragePlugin.SQLITE3) as bag:
            connection = bag.add_connection(TOPIC, kind, typestore=store)
            bag.write(connection, STAMP, store.serialize_cdr(message, kind))
    except (WriterError, sqlite3.Error) as error:
        raise OSError(str(error)) from error
