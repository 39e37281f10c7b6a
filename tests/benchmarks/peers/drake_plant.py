"""The loop in Drake: a multibody plant in C++, with law and magnetics as a system in Python.

The system has one event in each physics step and stores its result: its output is computed once in each
step, not once for each evaluation of the integrator. Drake has no Runge-Kutta method of order four; the one
of order three takes three evaluations in each step, and agrees as well.
"""

import numpy as np
import plain
from problem import Problem
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder, LeafSystem

NAME = "Drake, its plant and a Python law"

INTEGRATOR = "runge_kutta3"

# Torques act about the joint centre, where the rotor has its centre of mass: its mass has no effect.
MASS_kg = 1.0


class Controller(LeafSystem):
    """Law, allocation, drive and magnetics: from pose and rates to the torque on the hinges."""

    def __init__(self, problem: Problem) -> None:
        super().__init__()
        self._problem = problem
        self._law = plain.PlainPd(problem.law["stiffness"], problem.law["damping"], problem.nominal_inertia)
        self._step = 0
        self._command = self._current = np.zeros(problem.magnetics.sizes["groups"])
        self._torque_q = np.zeros(3)
        self.q_rad, self.current_A = [], []
        self._state = self.DeclareVectorInputPort("state", 6)
        # The stored values are attributes of Python; the state that Drake sees only says that they changed.
        stored = self.DeclareDiscreteState(1)
        after_a_step = {self.discrete_state_ticket(stored)}
        self.DeclareVectorOutputPort(
            "torque_q",
            3,
            lambda context, output: output.SetFromVector(self._torque_q),
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
        if substep == 0:
            R_SR, E = plain.rotation(q)
            torque_q = self._law(problem.reference[tick], q, qdot)
            G = plain.torque_matrix(R_SR, problem.actuator)
            self._command = plain.allocated(G, E, torque_q, drive.current_limit_A)
        distance = self._current - self._command
        mean = self._command + drive.mean_share * distance
        self._current = self._command + drive.decay * distance
        R_SR, E = plain.rotation(q + 0.5 * problem.step_s * qdot)  # in the middle of the step
        torque_S = plain.torque_matrix(R_SR, problem.actuator) @ mean
        self._torque_q = E.T @ torque_S - problem.disturbance[tick]
        if substep == 0:
            self.q_rad.append(q.copy())
            self.current_A.append(mean)
        self._step += 1


def run(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return angles (ticks, 3) and currents (ticks, 18) of the first step of each tick."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(_plant(problem))
    controller = builder.AddSystem(Controller(problem))
    builder.Connect(plant.get_state_output_port(), controller.GetInputPort("state"))
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
