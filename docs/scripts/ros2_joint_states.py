"""Node for ROS 2: topics that ``--publish`` offers, as `sensor_msgs/JointState`.

    python ros2_joint_states.py [ws://127.0.0.1:8765]

Needs rclpy of a ROS 2 installation, and websockets. A message, which is in CDR encoding, passes unchanged.
"""

import json
import struct
import sys

import rclpy
from sensor_msgs.msg import JointState
from websockets.sync.client import connect

ADDRESS = "ws://127.0.0.1:8765"
PROTOCOL = "foxglove.sdk.v1"
MESSAGE, HEAD = 1, struct.Struct("<BIQ")  # of a binary frame: kind, subscription, time in ns


def main(address):
    """Pass messages on until the server ends."""
    rclpy.init()
    node = rclpy.create_node("spheretwin")
    publishers = {}
    with connect(address, subprotocols=[PROTOCOL]) as socket:
        for frame in socket:
            if isinstance(frame, bytes):
                kind, subscription, _ = HEAD.unpack_from(frame)
                if kind == MESSAGE:
                    publishers[subscription].publish(frame[HEAD.size :])
                continue
            for channel in json.loads(frame).get("channels", ()):
                number = channel["id"]
                publishers[number] = node.create_publisher(JointState, channel["topic"], 10)
                wanted = [{"id": number, "channelId": number}]
                socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(*(sys.argv[1:] or [ADDRESS]))
