"""A page, the bench without a twin that it shows, and a browser."""

import pytest

from tests.browser import Browser
from tests.viz.bench import fake
from tests.viz.bench.on_page import errors, opened


@pytest.fixture(scope="module")
def browser():
    with Browser() as chromium:
        yield chromium


@pytest.fixture
def bench():
    return fake.Bench()


@pytest.fixture
def page(bench):
    with fake.shown(bench) as result:
        yield result


@pytest.fixture
def tabs(browser, page):
    """Two tabs of the page, of which the first operates."""
    result = [opened(browser, page), opened(browser, page)]
    yield result
    for tab in result:
        tab.close()


@pytest.fixture
def tab(browser, page):
    """The page in the browser, which has no error on its console at the end."""
    tab = opened(browser, page)
    yield tab
    assert errors(tab) == []
    tab.close()
