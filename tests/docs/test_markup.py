"""Pages can be read without seeing them: one title, headings in order, a text for each picture and link."""

import re
import sys
from itertools import pairwise
from urllib.parse import unquote

import pytest
from markdown_it import MarkdownIt

from tests.docs.snippets import PAGES, ROOT

sys.path.insert(0, str(ROOT / "docs"))
import generate

MARKDOWN = MarkdownIt("commonmark").enable("table")
FRONT_MATTER = re.compile(r"\A---\n.*?\n---\n", re.DOTALL)

TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in PAGES} | {
    f"{path} on the site": generate.readme(path) for path in generate.READMES
}
ON_THE_SITE = {name: text for name, text in TEXTS.items() if name not in generate.READMES}


def tokens_of(text):
    """All tokens of a page, also those within lines."""
    for token in MARKDOWN.parse(FRONT_MATTER.sub("", text)):
        yield token
        yield from token.children or ()


def fences(text, kind):
    """The contents of the blocks of a kind."""
    return [token.content for token in tokens_of(text) if token.type == "fence" and kind in token.info]


@pytest.mark.parametrize("name", ON_THE_SITE)
def test_a_page_has_one_title_and_no_level_is_left_out(name):
    levels = [int(token.tag[1]) for token in tokens_of(TEXTS[name]) if token.type == "heading_open"]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(below <= above + 1 for above, below in pairwise(levels))


@pytest.mark.parametrize("name", TEXTS)
def test_every_picture_and_link_has_a_text(name):
    tokens = list(tokens_of(TEXTS[name]))
    assert all(token.content.strip() for token in tokens if token.type == "image")
    for opened, following in pairwise(tokens):
        assert not (opened.type == "link_open" and following.type == "link_close"), opened.attrs["href"]
    for content in fences(TEXTS[name], "{image}"):
        assert re.search(r"^:alt: \S", content, re.MULTILINE)
    for content in fences(TEXTS[name], "{code-cell}"):
        assert (
            "axes_of(" not in content or "def axes_of" in content or re.search(r"^ +alt: .\w", content, re.M)
        )


@pytest.mark.parametrize("name", TEXTS)
def test_every_column_of_a_table_has_a_header(name):
    for opened, following in pairwise(MARKDOWN.parse(FRONT_MATTER.sub("", TEXTS[name]))):
        assert opened.type != "th_open" or following.content.strip(), opened.map


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_to_a_file_of_the_repository(page):
    """Also where the sources are read: pages that `make docs` generates are not there."""
    for token in tokens_of(page.read_text(encoding="utf-8")):
        target = token.attrs.get({"link_open": "href", "image": "src"}.get(token.type, ""), "")
        path = target.partition("#")[0]
        if path and "://" not in target and not target.startswith("mailto:"):
            assert "generated" not in path.split("/"), target
            assert (page.parent / unquote(path)).exists(), target


def test_on_the_site_links_to_sources_lead_to_their_pages():
    pages = generate.pages_of_files()
    assert all((ROOT / path).is_file() for path in pages)
    assert len(set(pages.values())) == len(pages)
    text = "[fields](../../twin/scenario/sections.py#x), [law](../../control/laws/afsm_eso.py), [b](b.md)"
    assert generate.on_site("how-to/a.md", text) == (
        "[fields](../reference/generated/scenario_fields.md#x), [law](../reference/generated/afsm_eso.md),"
        " [b](b.md)"
    )
    assert generate.on_site("reference/a.md", "[m](../../models/README.md)") == "[m](generated/actuator.md)"


def test_every_clip_has_a_picture_in_its_place():
    for name, text in TEXTS.items():
        classes = re.findall(r"^:class: (clip|still)$", text, re.MULTILINE)
        assert classes == ["clip", "still"] * (len(classes) // 2), name


@pytest.mark.parametrize("folder", ["tutorials", "how-to", "explanation"])
def test_an_index_links_to_every_page_of_its_folder(folder):
    """As links, which also work where the sources are read, and in the contents of the site."""
    text = TEXTS[f"docs/{folder}/index.md"]
    pages = {path.stem for path in (ROOT / "docs" / folder).glob("*.md")} - {"index"}
    assert set(re.findall(r"\]\((\w+)\.md\)", text)) == pages
    (contents,) = fences(text, "{toctree}")
    assert {line for line in contents.split() if not line.startswith(":")} == pages
