"""Sphinx's settings for the site; build.py lays the sources out and calls Sphinx."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # the extensions beside this file

import previews

import camviz

ROOT = Path(__file__).resolve().parents[2]
ADDRESS = "https://camviz.github.io/camviz/"

project = "camviz"
author = copyright = "The camviz authors"
version = release = camviz.__version__
language = "en"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "docstrings",
    "mathml",
    "deeper",
]
templates_path = ["templates"]
exclude_patterns = ["_static"]

nb_execution_mode = "off"  # the notebooks' saved outputs are tested; what moves is recorded by panes.py
nb_mime_priority_overrides = [("html", "text/html", 0), ("html", "text/plain", 90)]
nb_code_prompt_show = "Show the code"
nb_code_prompt_hide = "Hide the code"
myst_enable_extensions = ["dollarmath", "colon_fence", "attrs_inline"]
myst_heading_anchors = 4
html_math_renderer = "mathml"
suppress_warnings = ["config.cache", "mystnb.unknown_mime_type", "autosummary.import_cycle"]

autosummary_generate = True
autosummary_imported_members = True
autosummary_ignore_module_all = False
autodoc_typehints = "none"  # docstrings.py writes them
autodoc_member_order = "bysource"
default_role = "literal"

html_theme = "pydata_sphinx_theme"
html_title = "camviz"
html_static_path = [str(ROOT / "build/site-source/_static")]  # laid out by build.py
html_css_files = ["camviz.css"]
html_js_files = [("camviz.js", {"defer": "defer"})]
html_favicon = "static/favicon.svg"
html_baseurl = ADDRESS
html_context = {
    "default_mode": "light",  # without scripts; with them the reader's own setting holds, from the template's script on
    "address": ADDRESS,
    "previews": previews.sizes(ROOT / "build/site"),
}
html_copy_source = False
html_show_sourcelink = False
html_sidebars = {"index": [], "learn": [], "lessons/*": [], "search": []}
html_theme_options = {
    "logo": {"text": "camviz"},
    "navbar_end": ["theme-switcher", "repository"],
    "navbar_persistent": ["search-button"],
    "header_links_before_dropdown": 6,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": ["promise"],
    "back_to_top_button": False,
    "navigation_with_keys": False,
    "show_toc_level": 1,
    "collapse_navigation": True,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
