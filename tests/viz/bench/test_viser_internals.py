"""Internals of viser: each is compared with the installed viser."""

import dataclasses
from importlib import resources

import pytest
import viser
import viser._messages as messages

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.viz.bench import viser_internals
from spheretwin.viz.bench.viser_internals import MESSAGES, TITLE, with_guard, with_head


@pytest.mark.parametrize("form", MESSAGES, ids=lambda form: form.__struct_config__.tag)
def test_forms_of_messages_are_those_of_viser(form):
    original = getattr(messages, form.__struct_config__.tag, None)
    assert original, f"viser {viser.__version__} has no message {form.__struct_config__.tag}"
    assert form.__struct_fields__ == tuple(field.name for field in dataclasses.fields(original))


def test_the_page_has_the_title_and_the_head_that_are_replaced():
    page = (resources.files("viser") / "client" / "build" / "index.html").read_bytes()
    for part in (TITLE, b"<head>"):
        assert part in page, f"the page of viser {viser.__version__} has no {part}"
    assert b"<title>bench</title>" in with_head(page, "bench")


def test_a_server_without_the_guard_is_refused():
    """As if viser created its server in another way."""
    plain = viser_internals.servers.serve
    with pytest.raises(SpheretwinError, match="expected viser to create its server with"), with_guard(None):
        assert viser_internals.servers.serve is not plain
    assert viser_internals.servers.serve is plain
