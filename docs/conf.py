"""Sphinx: docs/make_site.py runs it on a copy of this folder with the generated pages added."""
import pathlib

project = "Boresight"
author = "the Boresight authors"
copyright = author
html_title = "Boresight"
language = "en"
extensions = ["myst_parser"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 4
# examples of JSON leave parts out with "..."
suppress_warnings = ["misc.highlighting_failure"]
exclude_patterns = ["examples/*", "images/*"]
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["wide.css"]
html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None
root_doc = "index"
