"""A page, and the bench without a twin that it shows."""

import pytest

from tests.viz.bench import fake


@pytest.fixture
def bench():
    return fake.Bench()


@pytest.fixture
def page(bench):
    with fake.shown(bench) as result:
        yield result
