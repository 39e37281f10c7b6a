"""Settings of the documentation site; `make docs` builds it without a network."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import generate  # noqa: E402  (it stands next to this file)

project = "spheretwin"
author = "The spheretwin authors"
project_copyright = "The spheretwin authors, MIT licence"
release = version = version_of("spheretwin")

extensions = [
    "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_design",
]  # fmt: skip
myst_enable_extensions = ["colon_fence", "deflist", "fieldlist"]
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
html_copy_source = False
html_show_sourcelink = False


def setup(app: object) -> None:
    """Write the pages that follow from the sources."""
    generate.write_pages(HERE / "reference" / "generated")
