"""The site: ``sphinx-build -W -b html docs build/site``."""

import sys
from pathlib import Path

import anmstrip

sys.path.insert(0, str(Path(__file__).parent))
import generate

generate.write_all()

project, author, copyright = "anmstrip", "The anmstrip developers", "The anmstrip developers"
release = version = anmstrip.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]
html_theme = "furo"
html_title = "anmstrip"
html_static_path, html_css_files = ["_static"], ["tables.css"]
exclude_patterns = ["README.md", "generated", "sg_execution_times.rst"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_ivar = True
html_copy_source = html_show_sourcelink = False


def escape_bars(app, what, name, obj, options, lines):  # type: ignore[no-untyped-def]
    """Let |v| in a docstring stand for itself."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app):  # type: ignore[no-untyped-def]
    """Connect what is special here."""
    app.connect("autodoc-process-docstring", escape_bars, priority=900)


sphinx_gallery_conf = {
    "examples_dirs": "../examples/gallery",
    "gallery_dirs": "gallery",
    "filename_pattern": "/plot_",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "capture_repr": (),
    "parallel": 2,
}
