"""The loop in Drake: a multibody plant in C++, law and magnetics a system in Python.

The system has one event a physics step, whose result is held in its state: its outputs are computed once a
step and not once for each evaluation of the integrator. Drake has no Runge-Kutta method of order four; the
one of order three takes three evaluations a step, and agrees as well.
"""

import numpy as np
import plain
from problem import Problem
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder, LeafSystem

NAME = "Drake, its plant and a Python law"

INTEGRATOR = "runge_kutta3"

# Torques act about the joint centre, where the rotor's centre of mass is: its mass enters nothing.
MASS_kg = 1.0


class Controller(LeafSystem):
    """Law, allocation, drive and magnetics: from pose and rates to what acts on the rotor."""

    def __init__(self, problem: Problem, rotor) -> None:
        super().__init__()
        self._problem, self._rotor = problem, rotor
        self._law = plain.PlainPd(problem.law["stiffness"], problem.law["damping"], problem.nominal_inertia)
        self._step = 0
        self._command = self._current = np.zeros(problem.magnetics.group_axes.shape[1])
        self._torque_S, self._hinges = np.zeros(3), np.zeros(3)
        self.q_rad, self.current_A = [], []
        self._state = self.DeclareVectorInputPort("state", 6)
        # Whatever is held is Python's own; the state that Drake sees says only that it has changed.
        held_torque = self.DeclareDiscreteState(1)
        after_a_step = {self.discrete_state_ticket(held_torque)}
        self.DeclareAbstractOutputPort(
            "torque_S",
            lambda: Value([ExternallyAppliedSpatialForce()]),
            self._write_torque,
            prerequisites_of_calc=after_a_step,
        )
        self.DeclareVectorOutputPort(
            "torque_q",
            3,
            lambda context, output: output.SetFromVector(self._hinges),
            prerequisites_of_calc=after_a_step,
        )
        self.DeclarePeriodicDiscreteUpdateEvent(problem.step_s, 0.0, self._advance)

    def _advance(self, context, discrete) -> None:
        problem, drive = self._problem, self._problem.drive
        tick, substep = divmod(self._step, problem.substeps)
        discrete.set_value(0, [self._step])
        if tick == len(problem.reference):
            return
        state = self._state.Eval(context)
        q, qdot = state[:3], state[3:]
        R_SR, E = plain.rotation(q)
        G = plain.torque_matrix(R_SR, problem.actuator)
        if substep == 0:
            torque_q = self._law(problem.reference[tick], q, qdot)
            self._command = plain.allocated(G, E, torque_q, drive.current_limit_A)
            self._hinges = -problem.disturbance[tick]
        distance = self._current - self._command
        mean = self._command + drive.mean_share * distance
        self._current = self._command + drive.decay * distance
        self._torque_S = G @ mean
        if substep == 0:
            self.q_rad.append(q.copy())
            self.current_A.append(mean)
        self._step += 1

    def _write_torque(self, context, output) -> None:
        force = ExternallyAppliedSpatialForce()
        force.body_index = self._rotor
        force.F_Bq_W = SpatialForce(tau=self._torque_S, f=np.zeros(3))
        output.set_value([force])


def run(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Angles (ticks, 3) and currents (ticks, 18), the first step's of each tick."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(_plant(problem))
    controller = builder.AddSystem(Controller(problem, plant.GetBodyByName("rotor").index()))
    builder.Connect(plant.get_state_output_port(), controller.GetInputPort("state"))
    builder.Connect(controller.GetOutputPort("torque_S"), plant.get_applied_spatial_force_input_port())
    builder.Connect(controller.GetOutputPort("torque_q"), plant.get_applied_generalized_force_input_port())
    simulator = Simulator(builder.Build())
    config = SimulatorConfig(
        integration_scheme=INTEGRATOR, max_step_size=problem.step_s, use_error_control=False
    )
    ApplySimulatorConfig(config, simulator)
    plant.SetPositions(
        plant.GetMyMutableContextFromRoot(simulator.get_mutable_context()), problem.reference[0, 0]
    )
    simulator.AdvanceTo(len(problem.reference) * problem.period_s)
    return np.array(controller.q_rad), np.array(controller.current_A)


def _plant(problem: Problem) -> MultibodyPlant:
    """Three hinges about x, y, z that meet in one point, and the rotor on the last."""
    plant = MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    ring = SpatialInertia(mass=0.0, p_PScm_E=np.zeros(3), G_SP_E=UnitInertia(0.0, 0.0, 0.0))
    of_rotor = SpatialInertia(
        mass=MASS_kg, p_PScm_E=np.zeros(3), G_SP_E=UnitInertia(*(problem.inertia / MASS_kg))
    )
    parent = plant.world_body()
    for name, inertia, axis in zip(
        ("outer", "inner", "rotor"), (ring, ring, of_rotor), np.eye(3), strict=True
    ):
        child = plant.AddRigidBody(name, inertia)
        plant.AddJoint(RevoluteJoint(f"{name}_hinge", parent.body_frame(), child.body_frame(), axis))
        parent = child
    plant.Finalize()
    return plant
