# SPDX-License-Identifier: Apache-2.0
"""Bags with messages of drivers, whose definitions no store of rosbags has."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

HEADER = "std_msgs/Header header\n"

# Definitions as the drivers have them; fields that are not read are shortened.
NODE = "uint8 role\nuint8 id\nfloat32 dis\nfloat32 fp_rssi\nfloat32 rx_rssi\n"
FRAME = "uint8 role\nuint8 id\nuint32 local_time\nuint32 system_time\nfloat32 voltage\n"
DEFINITIONS = {
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "nlink_parser/LinktrackNode2": NODE,
    "nlink_parser/LinktrackNodeframe2": FRAME + "float32[3] pos_3d\nLinktrackNode2[] nodes\n",
    "nlink_parser/LinktrackTagframe0": FRAME + "float32[3] pos_3d\nfloat32[8] dis_arr\n",
    "nlink_parser_ros2_interfaces/LinktrackNode2": NODE,
    "nlink_parser_ros2_interfaces/LinktrackNodeframe3": HEADER + FRAME + "LinktrackNode2[] nodes\n",
    "dwm1001_ros_interfaces/Anchor": "string id\ngeometry_msgs/Point location\nfloat64 dist\n",
    "dwm1001_ros_interfaces/UWBMeas": "Anchor[] measurements\n",
    "pozyx_drivers/AnchorInfo": HEADER + "string child_frame_id\nstring id\nbool status\n"
                                "geometry_msgs/Point position\nfloat64 distance\nint16 RSS\n",
    "marvelmind_nav/beacon_distance": "uint8 address_hedge\nuint8 address_beacon\n"
                                      "float64 distance_m\n",
    "gtec_msgs/Ranging": "int16 anchorId\nint16 tagId\nint32 range\nint32 seq\n"
                         "float64 errorEstimation\n",
    "uwb_driver/UwbRange": HEADER + "uint8 requester_id\nuint8 responder_id\nfloat32 distance\n"
                           "float32 distance_err\n",
    "apriltag_ros/AprilTagDetection": "int32[] id\nfloat64[] size\n"
                                      "geometry_msgs/PoseWithCovarianceStamped pose\n",
    "apriltag_ros/AprilTagDetectionArray": HEADER + "AprilTagDetection[] detections\n",
    "aruco_msgs/Marker": HEADER + "uint32 id\ngeometry_msgs/PoseWithCovariance pose\n"
                         "float64 confidence\n",
    "aruco_msgs/MarkerArray": HEADER + "aruco_msgs/Marker[] markers\n",
    "fiducial_msgs/FiducialTransform": "int32 fiducial_id\ngeometry_msgs/Transform transform\n",
    "fiducial_msgs/FiducialTransformArray": HEADER + "int32 image_seq\n"
                                            "FiducialTransform[] transforms\n",
}  # fmt: skip


def types_of(ros: str) -> Any:
    """Return a store of the types of a ROS and of the drivers."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == "ros1" else Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name.replace("/", "/msg/")))
    return store


def made(store: Any, name: str, given: Any) -> Any:
    """Return a message with these values, zero for all others."""
    from rosbags.interfaces import Nodetype

    def value(kind: Any, given: Any) -> Any:
        node, of = kind
        if node is Nodetype.NAME:
            return made(store, of, given or {})
        if node is Nodetype.BASE:
            return given if given is not None else {"string": "", "bool": False}.get(of[0], 0)
        (inner, base), length = of
        items = [0] * length if given is None else given
        if inner is Nodetype.NAME:
            return [made(store, base, one) for one in items]
        return np.array(items, base[0]) if base[0] != "bool" else np.array(items, np.bool_)

    _, fields = store.fielddefs[name]
    return store.types[name](**{key: value(kind, given.get(key)) for key, kind in fields})


def write(path: Path, messages: Iterable[tuple[int, str, str, Any]], ros: str) -> Path:
    """Write a bag of ROS 1 or ROS 2 with the definitions of its types inside.

    Messages are time [ns], topic, type and values; of a value that is missing it is zero.
    """
    from rosbags.rosbag1 import Writer as Ros1Writer
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Ros2Writer

    store = types_of(ros)
    writer = (Ros1Writer(path) if ros == "ros1" else
              Ros2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP))  # fmt: skip
    connections: dict[str, Any] = {}
    with writer:
        for at, topic, short, given in messages:
            name = short.replace("/", "/msg/")
            if topic not in connections:
                connections[topic] = writer.add_connection(f"/{topic}", name, typestore=store)
            pack = store.serialize_ros1 if ros == "ros1" else store.serialize_cdr
            writer.write(connections[topic], at, pack(made(store, name, given), name))
    return path
