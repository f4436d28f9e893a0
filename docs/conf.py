"""Sphinx configuration for `make docs`; the build downloads nothing."""

from __future__ import annotations

import rockerbogie

project = "rockerbogie"
author = "The rockerbogie developers"
version = release = rockerbogie.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_title = f"rockerbogie {release}"
exclude_patterns = ["_build"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
