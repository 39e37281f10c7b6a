"""Messages of ROS 2 of any definition, and JSON: their numbers by the names of their fields."""

import json
import struct

import numpy as np
import pytest
from mcap.writer import Writer

from spheretwin.models.telemetry import joint_states, ros_messages
from spheretwin.models.telemetry.joint_states import DEFINITION, TYPE, MessageEncoder, Topic
from spheretwin.models.telemetry.ros_messages import Definition

ARRAY = """# Data of any layout
std_msgs/MultiArrayLayout  layout        # dimensions
float64[]         data

================================================================================
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset

================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""
STAMP = {"sec": 1, "nanosec": 2}
OWN = """uint8 OFF=0
int16 count 7
bool is_on
float32[3] angle
Inner[<=2] parts
string<=10 text
===
MSG: my_msgs/Inner
float64 value
"""


def array_message(values):
    # Empty list of dimensions, offset, length, numbers aligned to 8 from the end of the header.
    return struct.pack("<BBHIII4x", 0, 1, 0, 0, 0, len(values)) + struct.pack(f"<{len(values)}d", *values)


def test_numbers_have_the_names_of_their_fields():
    message = Definition("std_msgs/msg/Float64MultiArray", ARRAY).decode(array_message([1.5, -2.0]))
    assert dict(ros_messages.numbers(message, "c")) == {
        "c/layout/data_offset": 0.0, "c/data/0": 1.5, "c/data/1": -2.0
    }  # fmt: skip
    assert ros_messages.stamp_ns(message) is None


def test_every_kind_of_field_is_read():
    # int16, bool, 3 float32 aligned to 4, length, 2 float64 aligned to 8, text.
    body = struct.pack("<h?x3fIxxxx2dI3s", 5, True, 0.5, 1.5, 2.5, 2, 3.0, 4.0, 3, b"ab\0")
    body = body[:16] + struct.pack("<I4x", 2) + body[24:]
    message = Definition("my_msgs/msg/Own", OWN).decode(b"\0\1\0\0" + body)
    assert message == {
        "count": 5, "is_on": True, "angle": (0.5, 1.5, 2.5), "parts": [{"value": 3.0}, {"value": 4.0}],
        "text": "ab",
    }  # fmt: skip
    assert list(dict(ros_messages.numbers(message, "o"))) == [
        "o/count", "o/angle/0", "o/angle/1", "o/angle/2", "o/parts/0/value", "o/parts/1/value"
    ]  # fmt: skip


@pytest.mark.parametrize("text", ["float64[ data", "Unknown field"])
def test_a_definition_that_is_none_is_refused(text):
    with pytest.raises(ValueError, match=r"expected a (field|definition) of"):
        Definition("a/B", text)


def test_a_file_has_the_numbers_of_all_topics_or_of_those_that_are_needed(tmp_path):
    state = MessageEncoder(Topic(["a", "b"], {"position": np.array([[1.0, 2.0]])}))
    with (path := tmp_path / "bag.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        array = "std_msgs/msg/Float64MultiArray"
        schemas = {
            "/joints": (TYPE, "ros2msg", DEFINITION), "/coils": (array, "ros2msg", ARRAY),
            "/json": ("Any", "jsonschema", "{}"), "/other": ("a.B", "protobuf", ""),
        }  # fmt: skip
        for name, (kind, encoding, text) in schemas.items():
            schema = writer.register_schema(kind, encoding, text.encode())
            message = {"ros2msg": "cdr", "jsonschema": "json"}.get(encoding, encoding)
            channel = writer.register_channel(name, message, schema)
            content = {
                "/joints": state.message(0, 5), "/coils": array_message([3.0]),
                "/json": json.dumps({"x": 1, "text": "a", "header": {"stamp": STAMP}}).encode(),
                "/other": b"\1\2",
            }[name]  # fmt: skip
            writer.add_message(channel, 20, content, 20)
        writer.finish()
    states = joint_states.read(path)
    assert states.time_ns.tolist() == [5, 20, 10**9 + 2]
    assert list(states.columns) == [
        "joints/position/a", "joints/position/b", "coils/layout/data_offset", "coils/data/0", "json/x"
    ]  # fmt: skip
    assert states.columns["coils/data/0"][1] == 3.0
    assert list(joint_states.read(path, names=["json/x"]).columns) == ["json/x"]
    assert len(joint_states.read(path, names=["none/x"]).columns) == 5
