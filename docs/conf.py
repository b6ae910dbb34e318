"""The documentation: ``make docs`` builds it. What can be read off the library is written by
``docs/making`` at each build, so that nothing of it becomes stale."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
os.environ["PYTHONWARNINGS"] = "ignore"  # of the kernels that execute pages

import stickslip  # noqa: E402

project = "stickslip"
author = "The stickslip developers"
copyright = author
version = release = stickslip.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "sphinx_design",
    "making.mathml",
]
root_doc = "index"
exclude_patterns = ["_build", "making", "**/.ipynb_checkpoints"]
language = "en"

# -- pages ---------------------------------------------------------------------------------------

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_inline"]
myst_heading_anchors = 4
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE / "_build" / "executed")
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_execution_in_temp = True
nb_execution_timeout = 120
nb_merge_streams = True
suppress_warnings = ["myst.header", "mystnb.unknown_mime_type", "config.cache"]
copybutton_prompt_text = r">>> |\.\.\. "
copybutton_prompt_is_regexp = True

# -- the reference ---------------------------------------------------------------------------------

autodoc_typehints = "none"  # numpydoc says them
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
numpydoc_xref_param_type = False
nitpicky = False

# -- looks: nothing is fetched from anywhere -------------------------------------------------------

html_theme = "pydata_sphinx_theme"
html_math_renderer = "mathml"
html_title = "stickslip"
html_static_path = ["_static"]
html_css_files = ["style.css"]
html_extra_path = ["_build/extra"]  # the pages of making/offline_pages.py, as they are
(HERE / "_build" / "extra").mkdir(parents=True, exist_ok=True)
html_favicon = "_static/icon.svg"  # or a browser asks for one that is not there
html_show_sourcelink = False
html_copy_source = False
html_search_scorer = str(HERE / "making" / "scorer.js")
html_theme_options: dict[str, Any] = {
    "logo": {"text": "stickslip"},
    "navbar_align": "left",
    "header_links_before_dropdown": 8,
    "navigation_with_keys": False,
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "show_toc_level": 2,
    "back_to_top_button": False,
}
html_context = {"default_mode": "auto"}
html_sidebars = {page: [] for page in ("index", "wrong", "search", "genindex")}


def setup(app: Any) -> None:
    """Write what is generated before anything is read."""
    from making import pages

    app.connect("builder-inited", lambda _: pages.write(HERE))
    app.connect("source-read", pages.to_the_site)
    app.connect("doctree-read", pages.with_keywords)
    app.connect("autodoc-process-docstring", pages.plain_bars)
