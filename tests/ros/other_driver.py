# SPDX-License-Identifier: Apache-2.0
"""A third-party UWB driver with messages of its own package.

It subscribes to the true pose and publishes at 10 Hz ids as int32 and millimetres as uint32, or
with the argument ``linktrack`` frames of a LinkTrack, which have no stamp.
"""

from __future__ import annotations

import sys
import warnings
from typing import Any

import numpy as np
import rospy
from genpy.dynamic import generate_dynamic
from nav_msgs.msg import Odometry

DEFINITION = "int32[] destination_id\nuint32[] distance\ntime[] stamp\n"
FRAME = ("uint8 role\nuint8 id\nuint32 local_time\nuint32 system_time\nfloat32 voltage\n"
         "LinktrackNode2[] nodes\n" + "=" * 80 + "\nMSG: nlink_parser/LinktrackNode2\n"
         "uint8 role\nuint8 id\nfloat32 dis\nfloat32 fp_rssi\nfloat32 rx_rssi\n")  # fmt: skip
ANCHORS = {1: (0, 0, 2), 2: (8, 0, 2), 3: (8, 6, 2), 4: (0, 6, 2), 5: (4, 3, 2.5)}
TAG = (0.1, 0.0, 0.5)


def main() -> None:
    rospy.init_node("other_driver")
    is_linktrack = sys.argv[1:2] == ["linktrack"]
    name, text = (("nlink_parser/LinktrackNodeframe3", FRAME) if is_linktrack else
                  ("other_driver/uwb_data", DEFINITION))  # fmt: skip
    kinds = generate_dynamic(name, text)
    kind = kinds[name]
    out = rospy.Publisher("uwb", kind, queue_size=10)
    count = [0]

    def on_truth(truth: Any) -> None:
        count[0] += 1
        if count[0] % 3:
            return
        pose = truth.pose.pose
        heading = 2.0 * np.arctan2(pose.orientation.z, pose.orientation.w)
        tag = np.array([pose.position.x + TAG[0] * np.cos(heading),
                        pose.position.y + TAG[0] * np.sin(heading), TAG[2]])  # fmt: skip
        distances = [round(1000 * float(np.linalg.norm(np.array(at) - tag)))
                     for at in ANCHORS.values()]  # fmt: skip
        if is_linktrack:
            node = kinds["nlink_parser/LinktrackNode2"]
            nodes = [node(1, one, 1e-3 * mm, 0.0, 0.0)
                     for one, mm in zip(ANCHORS, distances, strict=True)]  # fmt: skip
            out.publish(kind(2, 9, 0, 0, 3.7, nodes))
            return
        out.publish(kind(list(ANCHORS), distances, [truth.header.stamp] * len(ANCHORS)))

    rospy.Subscriber("ground_truth", Odometry, on_truth)
    while out.get_num_connections() == 0:
        rospy.rostime.wallsleep(0.01)
    print("ready", flush=True)
    rospy.spin()


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
