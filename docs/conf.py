"""Settings of the documentation site; `make docs` builds it without a network."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

import jupyter_client
from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxTranslator
from traitlets import default

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

# generate.py is in this folder, which Sphinx does not put on the path: the line above must come first.
import generate  # noqa: E402

project = "spheretwin"
author = "The spheretwin authors"
project_copyright = "The spheretwin authors, MIT licence"
release = version = version_of("spheretwin")

extensions = [
    "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_design",
]  # fmt: skip
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "fieldlist"]
html_math_renderer = "mathml"
myst_heading_anchors = 4
nb_execution_in_temp = True
nb_execution_raise_on_error = True
exclude_patterns = ["generate.py"]
templates_path = ["_templates"]

autodoc_member_order = "bysource"
autodoc_typehints = "description"
napoleon_google_docstring = False
add_module_names = False

html_theme = "furo"
html_title = f"spheretwin {release}"
html_theme_options = {"sidebar_hide_name": False, "navigation_with_keys": True}
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_copy_source = False
html_show_sourcelink = False


class EncryptedKernels(jupyter_client.AsyncKernelManager):
    """Kernels of the executed pages: keys encrypt what they exchange over TCP.

    IPython warns of kernels without them, and nbclient takes the class from here, without settings.
    """

    @default("transport_encryption")
    def _encrypt(self) -> str:
        return "auto"


jupyter_client.AsyncKernelManager = EncryptedKernels


def setup(app: Sphinx) -> None:
    """Write the pages that follow from the sources; links to those sources lead to the pages."""
    generate.write_pages(generate.ROOT / generate.GENERATED)
    app.connect("source-read", lead_to_pages)
    # Browsers draw MathML themselves: no script, no font and no other host is needed.
    app.add_html_math_renderer("mathml", inline_renderers=(equation, None), block_renderers=(equation, None))


def equation(visitor: SphinxTranslator, node: nodes.Element) -> None:
    """Write an equation as MathML."""
    block = isinstance(node, nodes.math_block)
    drawn = convert(node.astext(), display="block" if block else "inline")
    visitor.body.append(f'<div class="equation" tabindex="0">{drawn}</div>' if block else drawn)
    raise nodes.SkipNode


def lead_to_pages(app: Sphinx, page: str, source: list[str]) -> None:
    """Replace the links of a page before it is parsed, which checks them."""
    source[0] = generate.on_site(page, source[0])
