"""Settings of the site that `make docs` builds. Everything it needs is in the repository; nothing is fetched."""

import os
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "extensions"), str(HERE.parent), str(HERE.parent / "notebooks")]
PROJECT = tomllib.loads((HERE.parent / "pyproject.toml").read_text("utf-8"))["project"]

project = "harmolab"
author = "harmolab contributors"
copyright = "harmolab contributors, BSD-3-Clause"
release = version = PROJECT["version"]
language = "en"

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.githubpages",  # .nojekyll: a host must not leave out folders that begin with _
    "myst_parser",
    "sphinx_copybutton",
    "sphinx_design",
    "repository_links",
    "api_pages",
    "gallery_pages",
    "lab_pages",
]
exclude_patterns = ["_build"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
# A type in a docstring may be the name of two attributes as well; it is text, and no link is lost.
suppress_warnings = ["ref.python"]

# One backquote in the docstrings is a name or a value, not a link.
default_role = "code"
autodoc_typehints = "signature"
autodoc_type_aliases = {name: name for name in ("BoolArray", "FloatArray", "IntArray", "PathLike", "Progress")}
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 80
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_custom_sections = ["Returns"]  # a text as it stands; else each of its lines is taken for a value of its own

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

highlight_language = "none"  # commands and what they print; Python says so

html_theme = "furo"
html_title = "harmolab"
html_favicon = "static/beat.svg"
html_static_path = ["static"]
templates_path = ["templates"]
# A host shows this page at any depth, so that its links need the place of the site: "/", or "/name/" on a shared host.
html_additional_pages = {"404": "404.html"}
html_context = {"site": os.environ.get("HARMOLAB_SITE", "").rstrip("/") + "/"}
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
copybutton_exclude = ".linenos, .gp, .go"
