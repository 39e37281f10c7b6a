"""Networks as laws: against the evaluator of ONNX, against a law of known gains, and what is refused."""

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

import spheretwin
from spheretwin.control.law import NominalModel
from spheretwin.control.policy import BOUNDS, PolicyLaw, write_observation
from spheretwin.envs import TwinEnv
from spheretwin.models.base.errors import InputError

KNOWN = NominalModel(1e-3, 0.0, np.ones(3))
ACTIVATIONS = {"Relu": {}, "Tanh": {}, "Sigmoid": {}, "Elu": {"alpha": 0.7}, "LeakyRelu": {"alpha": 0.2}}


class Builder:
    """Graph of operations, one after the other."""

    def __init__(self):
        self.nodes, self.tensors, self.last = [], [], "observation"

    def add(self, kind, *constants, first=False, **attributes):
        names = [f"constant {len(self.tensors) + i}" for i in range(len(constants))]
        self.tensors += [
            numpy_helper.from_array(np.float32(own), name) for own, name in zip(constants, names, strict=True)
        ]
        result = f"result {len(self.nodes)}"
        given = [*names, self.last] if first else [self.last, *names]
        self.nodes.append(helper.make_node(kind, given, [result], **attributes))
        self.last = result
        return self

    def save(self, path, inputs=15):
        outputs = [helper.make_tensor_value_info(self.last, TensorProto.FLOAT, None)]
        row = helper.make_tensor_value_info("observation", TensorProto.FLOAT, [1, inputs])
        graph = helper.make_graph(self.nodes, "policy", [row], outputs, self.tensors)
        onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)]), str(path))
        return str(path)


def random_network(generator, kinds):
    network, width = Builder(), 15
    network.add("Sub", generator.normal(size=15)).add("Div", generator.uniform(0.5, 2.0, 15))
    for kind in kinds:
        wider = int(generator.integers(1, 40))
        weights = generator.normal(size=(wider, width)) / np.sqrt(width)
        network.add("Gemm", weights, generator.normal(size=wider), transB=1).add(kind, **ACTIVATIONS[kind])
        network.add("Mul", generator.uniform(-2.0, 2.0, wider))
        width = wider
    network.add("MatMul", generator.normal(size=(width, 3)) / width).add("Add", generator.normal(size=(1, 3)))
    network.add("Sub", generator.normal(size=3), first=True)
    return network.add("Clip", np.float32(-0.8), np.float32(0.9))


def torque_of(law, reference, measurement):
    torque = np.full(3, np.nan)
    law.step(0.0, reference, measurement, law.parameters, law.state.copy(), torque)
    return torque


@settings(max_examples=25, deadline=None)
@given(st.lists(st.sampled_from(sorted(ACTIVATIONS)), max_size=4), st.integers(0, 2**32 - 1))
def test_a_network_is_that_of_onnx(tmp_path_factory, kinds, seed):
    generator = np.random.default_rng(seed)
    path = random_network(generator, kinds).save(tmp_path_factory.mktemp("policy") / "net.onnx")
    law = PolicyLaw(law="policy", file=path, torque_limit_Nm=0.4).build(KNOWN)
    reference, measurement = generator.normal(size=(2, 3, 3))
    row = np.empty(15)
    write_observation(measurement[0], measurement[1], reference, row)
    (expected,) = ReferenceEvaluator(path).run(None, {"observation": np.float32(row[None])})
    # The evaluator computes in single precision; sums of 40 products lose some units of 1.2e-7 in each layer.
    torque = torque_of(law, reference, measurement)
    np.testing.assert_allclose(torque, 0.4 * expected[0], rtol=0, atol=0.4 * 2e-5)


def proportional(stiffness, damping):
    weights = np.zeros((3, 15))
    for k in range(3):
        weights[k, k], weights[k, 3 + k] = -stiffness, -damping
    return Builder().add("Gemm", weights, np.zeros(3), transB=1)


def test_a_policy_drives_the_session_as_it_drives_the_environment(tmp_path):
    """Coils without lag, as the environment applies torques.

    It holds them over a period; here currents are held, whose torque changes with the pose: by 0.1 % in a
    period, at angles of 0.06 rad. Observations of single precision are a hundred times more exact.
    """
    path = proportional(2.0, 0.2).save(tmp_path / "point.onnx")
    (tmp_path / "trained.py").write_text("from spheretwin import PolicyLaw\n")
    law = {"controller.law": f"{tmp_path / 'trained.py'}:PolicyLaw", "controller.file": path}
    changes = {
        "plant.engine": "lagrangian",
        "plant.step_s": 1e-3,
        "duration": 0.3,
        "disturbance.random_bound_Nm": 0.0,
    }
    run = spheretwin.simulate("sinusoid", {**changes, **law, "drive.time_constant_s": 1e-9})
    assert run.status == "completed"

    env = TwinEnv("Track", scenario="sinusoid", changes=changes, episode_s=0.3, variants=1)
    observation, _ = env.reset(seed=0)
    driven = [observation[6:9]]
    for _ in range(299):
        observation = env.step(-2.0 * observation[:3] - 0.2 * observation[3:6])[0]
        driven.append(observation[6:9])
    np.testing.assert_allclose(run.telemetry["q_rad"][:300], driven, rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("network", "message"),
    [
        (Builder().add("Gemm", np.ones((2, 15)), transB=1), "returns 3 torques, received 2"),
        (Builder().add("Sin"), "expected the operations Gemm, MatMul, .*, received Sin"),
        (Builder().add("Div", np.ones(15), first=True), "received Div"),
        (Builder().add("Gemm", np.ones((3, 14)), transB=1), "expected a network as ONNX, received"),
        (Builder().add("Gemm", np.full((3, 15), np.inf), transB=1), "expected finite numbers"),
        (Builder().add("Gemm", np.ones((15, 3)), transA=1), "received Gemm with transA"),
    ],
)
def test_refuses_other_networks(tmp_path, network, message):
    with pytest.raises(InputError, match=message):
        PolicyLaw(law="policy", file=network.save(tmp_path / "net.onnx"))


def test_refuses_branches_and_files_of_another_kind(tmp_path):
    network = Builder().add("Tanh")
    network.nodes.append(helper.make_node("Add", [network.last, "observation"], ["sum"]))
    network.last = "sum"
    with pytest.raises(InputError, match="expected one input of each layer, received Add with 2"):
        PolicyLaw(law="policy", file=network.save(tmp_path / "net.onnx"))
    (tmp_path / "text.onnx").write_text("no network")
    for name in ("text.onnx", "missing.onnx"):
        with pytest.raises(InputError, match=f"policy .*{name}: expected a "):
            PolicyLaw(law="policy", file=str(tmp_path / name))


def test_observations_beyond_their_bounds_are_cut_and_nan_is_zero():
    row, measurement = np.empty(15), np.array([[1e9, np.nan, -1e9], [1e9, np.nan, -1e9], [0.0, 0.0, 0.0]])
    write_observation(measurement[0], measurement[1], np.zeros((3, 3)), row)
    expected = np.concatenate([np.tile([1.0, 0.0, -1.0], 4), np.zeros(3)]) * BOUNDS
    np.testing.assert_array_equal(row, expected)
