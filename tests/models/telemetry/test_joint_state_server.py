"""Joint states on a WebSocket: what a client of Foxglove's protocol receives."""

import json
import struct
import subprocess
import sys
from threading import Event, Thread

import numpy as np
import pytest
from websockets.sync.client import connect

import spheretwin
from spheretwin.machine.state_estimation import signals
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.telemetry import joint_states
from spheretwin.models.telemetry.joint_state_server import JointStateServer, published
from spheretwin.models.telemetry.ros_messages import Definition
from spheretwin.models.telemetry.table import Table, with_currents
from tests.conftest import ROOT

MESSAGE, PATIENCE_s = 1, 10.0


class Client:
    """Client that subscribes to all topics."""

    def __init__(self, address):
        self.socket = connect(address, subprotocols=["foxglove.sdk.v1"], open_timeout=PATIENCE_s)
        self.topics = {}
        self.definition = None

    def subscribe(self, topics):
        while set(self.topics.values()) < topics:
            said = json.loads(self.socket.recv(PATIENCE_s))
            for channel in said.get("channels", ()):
                assert (channel["encoding"], channel["schemaName"]) == ("cdr", joint_states.TYPE)
                self.definition = Definition(channel["schemaName"], channel["schema"])
                self.topics[channel["id"]] = channel["topic"]
        wanted = [{"id": number, "channelId": number} for number in self.topics]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def receive(self):
        while True:
            data = self.socket.recv(PATIENCE_s)
            if isinstance(data, bytes) and data[0] == MESSAGE:
                subscription, stamp_ns = struct.unpack_from("<IQ", data, 1)
                return self.topics[subscription], stamp_ns, self.definition.decode(data[13:])


@pytest.fixture(scope="module")
def run():
    return spheretwin.simulate("sinusoid", {"duration": 0.02})


def received(server, rows, count):
    """Messages of some rows by topic; the first row makes the channels known."""
    server.write(rows.rows(0, 1))
    client = Client(server.address)
    client.subscribe({"/angles", "/currents", "/telemetry"})
    messages = {}
    while not messages:  # the subscription needs some time
        server.write(rows.rows(0, 1))
        try:
            topic, _, _ = client.receive()
            messages = {topic: []}
        except TimeoutError:
            continue
    server.write(rows.rows(1, count))
    by_topic = {}
    while any(len(by_topic.get(topic, ())) < count - 1 for topic in ("/angles", "/currents", "/telemetry")):
        topic, stamp_ns, message = client.receive()
        if stamp_ns > 0:
            by_topic.setdefault(topic, []).append((stamp_ns, message))
    client.socket.close()
    return by_topic


def test_a_client_receives_the_rows_of_a_run(run):
    rows = run.telemetry
    with published(0) as (server,):
        by_topic = received(server, rows, len(rows))
    stamps, messages = zip(*by_topic["/angles"], strict=True)
    assert stamps == tuple(joint_states.stamps_ns(rows["t_s"][1:]))
    assert messages[0]["name"] == list(joint_states.ANGLE_NAMES)
    np.testing.assert_array_equal([own["position"] for own in messages], rows["q_rad"][1:])
    np.testing.assert_array_equal([own["velocity"] for own in messages], rows["qdot_rad_s"][1:])
    currents = [own["effort"] for _, own in by_topic["/currents"]]
    np.testing.assert_array_equal(currents, rows["current_command_A"][1:])
    names = by_topic["/telemetry"][0][1]["name"]
    torque = next(place for place, name in enumerate(names) if name.startswith("torque_Nm"))
    torque = [own["effort"][torque] for _, own in by_topic["/telemetry"]]
    np.testing.assert_array_equal(torque, rows["torque_Nm"][1:, 0])


def test_the_topics_of_a_shadow_are_its_estimates():
    own = signals(False)
    values = np.random.default_rng().normal(size=(4, sum(signal.size for signal in own)))
    rows = with_currents(Table(own, values), np.ones((4, 18)))
    topics = joint_states.topics_of(rows)
    np.testing.assert_array_equal(topics["angles"].fields["position"], rows["q_estimated_rad"])
    np.testing.assert_array_equal(topics["currents"].fields["effort"], np.ones((4, 18)))
    assert any(name.startswith("q_measured_rad") for name in topics["telemetry"].names)


ROS = """
import sys, types

def module(name, **content):
    sys.modules[name] = types.SimpleNamespace(**content)

class Publisher:
    def __init__(self, kind, topic, depth):
        self.topic = topic
    def publish(self, message):
        print(self.topic, message.hex(), flush=True)

node = types.SimpleNamespace(create_publisher=Publisher, destroy_node=lambda: None)
module("rclpy", init=lambda: None, create_node=lambda name: node, shutdown=lambda: None)
module("sensor_msgs")
module("sensor_msgs.msg", JointState=object)
import runpy
runpy.run_path(sys.argv[1])["main"](sys.argv[2])
"""
"""The example with ROS replaced by publishers that print."""


def publish_until(stop, server, rows):
    """Publish again and again, as a client needs some time to subscribe."""
    while not stop.wait(0.05):
        server.write(rows)


def test_the_example_node_passes_messages_on(run):
    rows, example = run.telemetry, str(ROOT / "docs" / "scripts" / "ros2_joint_states.py")
    with published(0) as (server,):
        server.write(rows.rows(0, 1))
        program = [sys.executable, "-c", ROS, example, server.address]
        with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as node:
            received = {}
            stop = Event()
            publishing = Thread(target=publish_until, args=(stop, server, rows.rows(0, 1)))
            publishing.start()
            for line in node.stdout:
                topic, message = line.split()
                received[topic] = bytes.fromhex(message)
                if len(received) == 3:
                    break
            stop.set()
            publishing.join()
            node.kill()
    topics = joint_states.topics_of(rows.rows(0, 1))
    expected = {
        f"/{name}": joint_states.MessageEncoder(topic).message(0, 0) for name, topic in topics.items()
    }
    assert received == expected


def test_a_port_that_is_taken_is_an_error(run):
    with published(0) as (server,):
        port = int(server.address.rpartition(":")[2])
        with pytest.raises(SpheretwinError, match=f"publish: expected a free port, received {port}"):
            JointStateServer(port)


def test_names_the_extra_that_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(InputError, match="publish: expected foxglove-sdk, which the extra machine installs"):
        JointStateServer(0)
