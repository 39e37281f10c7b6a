"""A page of Markdown as HTML: its tables, and all tags escaped."""

from spheretwin.viz.pages import html, markdown


def test_tables_of_markdown_become_tables():
    lines = markdown.table(("law", "α"), [("a | b", "1.5"), ("*c*", "2")], (False, True))
    assert lines == ["| law | α |", "|---|---:|", "| a \\| b | 1.5 |", "| *c* | 2 |"]
    made = html.page("title", "\n".join(lines))
    assert made.count("<tr>") == 3
    assert "<td>a | b</td>" in made
    assert '<td style="text-align:right">1.5</td>' in made
    assert "<td><em>c</em></td>" in made


def test_tags_are_shown_and_not_obeyed():
    made = html.page("a < b", "<script>alert(1)</script> and [a link](javascript:alert(1))")
    assert "<title>a &lt; b</title>" in made
    assert "<script" not in made
    assert 'href="javascript' not in made
