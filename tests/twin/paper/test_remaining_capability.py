"""What is left along a path: by hand, by linear programmes, and by currents tried out."""

import numpy as np
import pytest
from scipy.optimize import linprog

from spheretwin.models import actuator
from spheretwin.models.design.capability import torque_matrices
from spheretwin.paper.fault_outcomes import MOST, RemainingTorque, remaining_torque

# Four groups about x, y, z and, at half the torque, about z again.
BY_HAND = np.array([[[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0.5]]])
ALONG_Z = np.array([[0.0, 0.0, 2.0]])
LIMIT_A = 8.0


def path(poses, seed=0):
    random = np.random.default_rng(seed)
    q = random.uniform(-0.9, 0.9, (poses, 3))
    return torque_matrices(q, actuator.load()), random.normal(0.0, 0.2, (poses, 3))


def test_all_groups_by_hand():
    # Least norm asks the stronger for twice the current: 1 to 0.5, and 1.25 of torque at the limit.
    expected = RemainingTorque(1.5 * LIMIT_A / 2, 1.25 * LIMIT_A / 2, 1.0, 1.0, 3)
    assert remaining_torque(BY_HAND, ALONG_Z, LIMIT_A, ()) == pytest.approx(expected)
    # The weaker group alone.
    expected = RemainingTorque(0.5 * LIMIT_A / 2, 0.5 * LIMIT_A / 2, 0.25 / 1.25, 0.5, 3)
    assert remaining_torque(BY_HAND, ALONG_Z, LIMIT_A, (2,)) == pytest.approx(expected)
    assert remaining_torque(BY_HAND, np.zeros((1, 3)), LIMIT_A, ()).torque == MOST  # nothing is needed


@pytest.mark.parametrize(("opened", "rank"), [((2, 3), 2), ((0, 2, 3), 1)])
def test_a_lost_direction_leaves_no_torque(opened, rank):
    result = remaining_torque(BY_HAND, ALONG_Z, LIMIT_A, opened)
    assert (result.torque, result.least_norm, result.least_share, result.rank) == (0.0, 0.0, 0.0, rank)


def test_of_five_groups_two_leave_a_plane():
    G = np.random.default_rng(4).normal(size=(6, 3, 5))
    result = remaining_torque(G, np.ones((6, 3)), LIMIT_A, (0, 2, 4))
    assert (result.rank, result.torque) == (2, 0.0)


def test_the_least_of_a_path_is_that_of_its_worst_pose():
    G, torque_S = path(20)
    whole = remaining_torque(G, torque_S, LIMIT_A, (1, 5, 8))
    alone = [remaining_torque(G[i : i + 1], torque_S[i : i + 1], LIMIT_A, (1, 5, 8)) for i in range(20)]
    for name in ("torque", "least_norm", "least_share", "singular_value_Nm_per_A", "rank"):
        assert getattr(whole, name) == min(getattr(each, name) for each in alone)


@pytest.mark.parametrize("opened", [(0,), (3, 9, 14), (0, 1, 2, 3, 8, 13, 16)])
def test_torque_is_that_of_a_linear_programme(opened):
    """The largest share with currents of the others within the limit that give it."""
    G, torque_S = path(8, seed=1)
    others = [group for group in range(18) if group not in opened]
    for pose in range(len(G)):
        result = remaining_torque(G[pose : pose + 1], torque_S[pose : pose + 1], LIMIT_A, opened)
        equal = np.column_stack([G[pose][:, others], -torque_S[pose]])
        bounds = [(-LIMIT_A, LIMIT_A)] * len(others) + [(0, None)]
        solved = linprog([0.0] * len(others) + [-1.0], A_eq=equal, b_eq=np.zeros(3), bounds=bounds)
        # The solver's own tolerance, 1e-7 of its equations.
        assert result.torque == pytest.approx(min(solved.x[-1], MOST), rel=1e-6)
        assert result.least_norm <= result.torque * (1 + 1e-9)


@pytest.mark.parametrize("opened", [(0,), (3, 9, 14)])
def test_what_comes_is_what_currents_for_all_groups_give(opened):
    """Tried out: least-norm currents of all groups, those of the open ones gone, in many directions."""
    G, torque_S = path(1, seed=2)
    result = remaining_torque(G, torque_S, LIMIT_A, opened)
    remaining = G[0].copy()
    remaining[:, list(opened)] = 0.0
    gives = remaining @ np.linalg.pinv(G[0])  # torque given of a torque asked for
    # In the norm of the currents that are asked for, |u| with torque = C u.
    C = np.linalg.cholesky(G[0] @ G[0].T)
    u = np.random.default_rng(3).normal(size=(3, 20_000))
    u /= np.linalg.norm(u, axis=0)
    shares = np.sum(u * np.linalg.solve(C, gives @ C @ u), axis=0)
    assert shares.min() >= result.least_share - 1e-12
    # 20,000 directions come within 0.03 rad of the worst one, whose share is the least to second order.
    assert shares.min() == pytest.approx(result.least_share, abs=1e-3)
