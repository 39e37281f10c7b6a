"""Load and random torque of the paper, seeded; terms add to them."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.disturbances import (
    ConstantDisturbance,
    Disturbance,
    Draws,
    RandomDisturbance,
    SinusoidalDisturbance,
    StepDisturbance,
    term_draws,
)
from spheretwin.models.base.errors import InputError
from spheretwin.session import Session

T = np.linspace(0, 2, 2001)


def draws(seed=0):
    paper = np.random.default_rng(seed).random(len(T))
    return Draws(paper, lambda place: term_draws(seed, 0, len(T), place))


def test_load_is_constant_on_every_axis():
    np.testing.assert_array_equal(Disturbance(load=2.0).sample(T, draws()), np.full((len(T), 3), 0.1))


@pytest.mark.parametrize(("envelope", "sign"), [("decaying", -1), ("growing", 1)])
def test_random_torque_is_equation_56(envelope, sign):
    disturbance = Disturbance(random_bound_Nm=0.05, gamma_envelope=envelope)
    sampled = disturbance.sample(T, draws())
    r = sampled[:, 0] / np.cos(np.pi * T)
    r = np.where(np.abs(np.cos(np.pi * T)) > 0.1, r, np.nan)
    known = np.isfinite(r)
    assert np.all(np.abs(r[known]) <= 0.05)
    assert np.nanstd(r) == pytest.approx(0.05 / np.sqrt(3), rel=0.05)  # uniform, 1,900 draws
    np.testing.assert_allclose(sampled[known, 1], (r * np.sin(-np.pi * T))[known], atol=1e-15)
    np.testing.assert_allclose(sampled[known, 2], (r * np.exp(sign * np.pi * T))[known], rtol=1e-12)


def test_seed_decides():
    disturbance = Disturbance(random_bound_Nm=0.05)
    first, again, other = (disturbance.sample(T, draws(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


TERMS = (
    ConstantDisturbance(torque_Nm=(0.01, -0.02, 0.03)),
    RandomDisturbance(bound_Nm=(0.02, 0.03, 0.04)),
    StepDisturbance(times_s=(0.5, 1.0), torques_Nm=((0.1, 0.0, 0.0), (0.0, -0.1, 0.0))),
    SinusoidalDisturbance(
        amplitude_Nm=(0.05, 0.0, 0.02), frequency_Hz=(3.0, 1.0, 0.5), phase_rad=(0.0, 0.0, 1.0)
    ),
    RandomDisturbance(bound_Nm=(0.02, 0.03, 0.04)),
)


def test_terms_add():
    both = Disturbance(load=1.5, random_bound_Nm=0.05, terms=TERMS).sample(T, draws())
    alone = [Disturbance(load=1.5, random_bound_Nm=0.05).sample(T, draws())]
    alone += [term.sample(T, lambda place=place: draws().of_term(place)) for place, term in enumerate(TERMS)]
    # Six numbers below 0.3 N·m, whose units in the last place are 6e-17.
    np.testing.assert_allclose(both, sum(alone), rtol=0, atol=3e-16)
    assert all(np.abs(each).max() > 0.01 for each in alone)


def test_a_further_term_moves_no_bit_of_the_others():
    for terms in (TERMS, TERMS[::-1]):
        before = Disturbance(random_bound_Nm=0.05, terms=terms).sample(T, draws())
        more = Disturbance(random_bound_Nm=0.05, terms=(*terms, RandomDisturbance(bound_Nm=(0.0, 0.0, 0.0))))
        assert more.sample(T, draws()).tobytes() == before.tobytes()


def test_random_terms_differ_from_each_other_and_from_the_paper_s():
    kinds = [draws().paper, draws().of_term(0), draws().of_term(1), draws(1).of_term(0)]
    correlation = np.corrcoef(kinds) - np.eye(4)
    assert np.abs(correlation).max() < 4 / np.sqrt(len(T))  # four standard deviations of independent ones


# --- from a file to a run

FILE = """
duration = 0.1
seed = 5
[trajectory]
shape = "hold"
[disturbance]
load = 1.0
random_bound_Nm = 0.01
[[disturbance.terms]]
kind = "steps"
times_s = [0.02, 0.05]
torques_Nm = [[0.01, 0.0, 0.0], [0.0, 0.02, 0.0]]
[[disturbance.terms]]
kind = "random"
bound_Nm = [0.01, 0.02, 0.0]
[[disturbance.terms]]
kind = "table"
file = "{table}"
"""


@pytest.fixture
def scenario(tmp_path):
    (tmp_path / "torque.csv").write_text("t_s,alpha_Nm,beta_Nm,gamma_Nm\n0,0,0,0\n0.1,0,0,0.1\n")
    (tmp_path / "mine.toml").write_text(FILE.format(table=tmp_path / "torque.csv"))
    return scenarios.load(str(tmp_path / "mine.toml"))


def test_scenario_file_names_them(scenario):
    rows = Session(scenario).advance(100)
    t = rows["t_s"]
    paper = np.random.default_rng(5).random(1000)[:100]  # the stream of a whole block
    expected = 0.05 + Disturbance(random_bound_Nm=0.01).sample(t, Draws(paper, lambda place: paper))
    expected[:, 0] += np.where((t >= 0.02) & (t < 0.05), 0.01, 0.0)
    expected[:, 1] += np.where(t >= 0.05, 0.02, 0.0)
    u = 2 * term_draws(5, 0, 100, 1) - 1
    expected[:, 0] += 0.01 * u * np.cos(np.pi * t)
    expected[:, 1] -= 0.02 * u * np.sin(np.pi * t)
    expected[:, 2] += t
    np.testing.assert_allclose(rows["disturbance_Nm"], expected, atol=1e-15)


def test_session_with_terms_goes_on_from_a_snapshot_whose_file_is_gone(scenario, tmp_path):
    session = Session(scenario)
    session.advance(40)
    before = session.snapshot()
    ahead = session.advance(1500).values.tobytes()
    (tmp_path / "torque.csv").unlink()
    session.restore(before)
    cut = [session.advance(ticks).values.tobytes() for ticks in (1, 958, 2, 539)]
    assert b"".join(cut) == ahead


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ('kind = "random"\nbound_Nm = [-0.1, 0.0, 0.0]', "bound_Nm"),
        (
            'kind = "steps"\ntimes_s = [1.0, 0.5]\ntorques_Nm = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]',
            "rising times",
        ),
        ('kind = "table"\nfile = "absent.csv"', "expected a readable CSV file"),
    ],
)
def test_bad_terms_are_refused_on_one_line(tmp_path, line, complaint):
    path = tmp_path / "bad.toml"
    path.write_text(f'[trajectory]\nshape = "hold"\n[[disturbance.terms]]\n{line}\n')
    with pytest.raises(InputError) as refusal:
        scenarios.load(str(path))
    assert complaint in str(refusal.value)
    assert "\n" not in str(refusal.value)
