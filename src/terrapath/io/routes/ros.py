"""A ROS 2 bag with one nav_msgs/Path, for a robot to follow."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...validation import Array
from .profile import headings, heights, slopes
from .route import Route

TOPIC, FRAME = "/plan", "map"
# The oldest version that the library writes: every ROS 2 since Humble reads it.
BAG_VERSION: Literal[8] = 8
# No date: the same route gives the same bytes, and ROS reads time 0 as "any time".
STAMP = 0


def positions(route: Route) -> Array:
    """(m, 3): the route's points in metres; heights without a unit are in the plane's."""
    path, points = route.path, route.points
    return np.column_stack([path.ground.metres * points, heights(path, points)])


def orientations(route: Route) -> Array:
    """(m, 4): quaternions x, y, z, w of a vehicle that faces along the route, on the ground.

    Yaw is counted from the x axis, anticlockwise; nose up is a negative pitch (REP 103).
    """
    ahead = headings(route.points)
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    pitch = -np.radians(slopes(route.path).along[route.samples])
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_euler("ZY", np.column_stack([yaw, pitch]))
    return np.asarray(turned.as_quat(canonical=True))


def _message(route: Route, types: Any) -> Any:
    """The nav_msgs/Path."""
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
    places, turns = positions(route).tolist(), orientations(route).tolist()
    poses = [
        pose_stamped(heading, pose(point(*place), quaternion(*turn)))
        for place, turn in zip(places, turns, strict=True)
    ]
    return path(heading, poses)


def write(route: Route, folder: Path) -> None:
    """Write a bag into a folder that does not exist yet."""
    import sqlite3

    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.rosbag2.errors import WriterError
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    message = _message(route, store.types)
    kind = message.__msgtype__
    try:
        with Writer(folder, version=BAG_VERSION, storage_plugin=StoragePlugin.SQLITE3) as bag:
            connection = bag.add_connection(TOPIC, kind, typestore=store)
            bag.write(connection, STAMP, store.serialize_cdr(message, kind))
    except (WriterError, sqlite3.Error) as error:
        raise OSError(str(error)) from error
