"""The page itself: the library, the figures, and the switches of the runs."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import plotly.graph_objects as plotly
from plotly.offline import get_plotlyjs

from spheretwin.viz.compared.colours import run_colours
from spheretwin.viz.compared.run import Run
from spheretwin.viz.page import html

# The browser itself is told to ask no host for anything.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:;"
    " font-src data:; form-action 'none'; base-uri 'none'"
)

STYLE = """
body { max-width: 84rem; }
.runs { position: sticky; top: 0; z-index: 2; display: flex; flex-wrap: wrap; gap: 0.4rem;
  padding: 0.5rem 0; background: var(--paper); }
.runs button { font: inherit; font-size: 0.9rem; padding: 0.2rem 0.7rem; border-radius: 1rem;
  border: 1px solid var(--faint); background: var(--soft); color: inherit; cursor: pointer; }
.runs button::before { content: ""; display: inline-block; width: 1.2rem; height: 0.25rem;
  margin-right: 0.5rem; vertical-align: middle; background: var(--run); }
.runs button[aria-pressed="false"] { opacity: 0.4; text-decoration: line-through; }
.plot { background: #fff; border-radius: 4px; }
"""

SCRIPT = """
const config = {displaylogo: false, responsive: true, doubleClick: "reset", plotlyServerURL: "",
  modeBarButtons: [["zoom2d", "pan2d", "resetScale2d"]]};
const plots = Object.keys(figures).map((name) => document.getElementById(name));
for (const plot of plots) {
  Plotly.newPlot(plot, figures[plot.id].data, figures[plot.id].layout, config);
}
for (const button of document.querySelectorAll(".runs button")) {
  button.addEventListener("click", () => {
    const on = button.getAttribute("aria-pressed") === "false";
    button.setAttribute("aria-pressed", on);
    for (const plot of plots) {
      const its = plot.data.flatMap((trace, i) => (trace.meta === button.dataset.run ? [i] : []));
      Plotly.restyle(plot, {visible: on}, its);
    }
  });
}
"""


def page(
    title: str,
    runs: Sequence[Run],
    over_time: plotly.Figure,
    spectra: plotly.Figure,
    above: str,
    below: str,
) -> str:
    """Whole page.

    Parameters
    ----------
    title : str
    runs : sequence of Run
    over_time, spectra : Figure
    above, below : str
        What stands above and below the figures, in Markdown.
    """
    figures = {"over-time": over_time, "spectra": spectra}
    content = ", ".join(f'"{name}": {figure.to_json()}' for name, figure in figures.items())
    body = [
        html.rendered(above),
        f'<div class="runs" role="group" aria-label="runs">{_switches(runs)}</div>',
        *(f'<div class="plot" id="{name}"></div>' for name in figures),
        html.rendered(below),
        f"<script>{get_plotlyjs()}</script>",
        # No text of a user's ends the script.
        f"<script>const figures = {{{content}}};".replace("<", "\\u003c").replace("\\u003c", "<", 1),
        f"{SCRIPT}</script>\n",
    ]
    head = f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n<style>{STYLE}</style>'
    return html.whole(title, "\n".join(body), head)


def _switches(runs: Sequence[Run]) -> str:
    colours = run_colours([run.law for run in runs])
    return "".join(
        f'<button type="button" data-run="{place}" aria-pressed="true" style="--run: {colour}">'
        f"{escape(run.label)}</button>"
        for place, (run, colour) in enumerate(zip(runs, colours, strict=True))
    )
