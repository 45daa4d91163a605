"""How Sphinx builds these pages; it needs asperity installed and no network."""

import os
import sys
import warnings
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from sphinx.addnodes import toctree
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

import asperity
from asperity.ledger import entries
from asperity.ledger.entry import page_of

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
reference = import_module("reference")
# Pictures of the gallery are drawn to files, also where a display exists.
os.environ.setdefault("MPLBACKEND", "Agg")

# docs/ledger.md includes the rows
generated = HERE / "generated"
generated.mkdir(exist_ok=True)
(generated / "ledger.md").write_text(page_of(entries()), encoding="utf-8")
# docs/paper-figures.md includes the figures
sys.path.insert(0, str(HERE / "examples"))
paper_figures = import_module("paper_figures")
paper_figures.main(generated / "figures")
(generated / "figures.md").write_text(paper_figures.page(), encoding="utf-8")
# pages of the gallery show them
import_module("thumbnails").write_thumbnails(generated / "thumbnails")
# docs/api/index.md lists the pages of the tasks
reference.write_pages(HERE / "api" / "generated")

project = "asperity"
author = "The asperity developers"
copyright = f"2026, {author}"
version = release = asperity.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = [
    *("_build", "_templates", "tutorials", "how-to", "examples"),
    *("generated/*.md", "generated/backreferences", "**/sg_execution_times*", "**/*.ipynb"),
]
templates_path = ["_templates"]

html_theme = "furo"
html_title = f"asperity {release}"
# MathJax as one file that needs neither network nor fonts; the package has some hundred files more
mathjax = Path(str(find_spec("sphinx-mathjax-offline").origin)).parent / "static" / "mathjax" / "tex-svg.js"
html_static_path = [str(mathjax), "pages.css"]
html_css_files = ["pages.css"]
mathjax_path = mathjax.name

myst_enable_extensions = ["amsmath", "dollarmath"]
myst_heading_anchors = 3

# Links into other documents, by inventories of the few names that these pages mention: no network is needed.
inventories = reference.write_inventories(HERE / "links.txt", generated)
addresses = {
    "python": "https://docs.python.org/3/",
    "numpy": "https://numpy.org/doc/stable/",
    "scipy": "https://docs.scipy.org/doc/scipy/",
    "matplotlib": "https://matplotlib.org/stable/",
}
intersphinx_mapping = {name: (address, inventories[name]) for name, address in addresses.items()}

# Tutorials and short examples are executed; the studies take minutes, so that their source is shown only.
sphinx_gallery_conf = {
    "examples_dirs": ["tutorials", "how-to", "examples"],
    "gallery_dirs": ["generated/tutorials", "generated/how-to", "generated/examples"],
    "filename_pattern": r"/(tutorials|how-to)/",
    "ignore_pattern": r"(gallery|front_picture|paper_figures|true_disk_pictures)\.py$",
    "within_subsection_order": "reference.StoryOrder",
    "backreferences_dir": "generated/backreferences",
    "doc_module": ("asperity",),
    "reference_url": {"asperity": None},
    "image_scrapers": ("matplotlib",),
    "matplotlib_animations": False,
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": False,
    "min_reported_time": 10**6,
    "write_computation_times": False,
    "default_thumb_file": str(HERE / "gallery" / "walls.png"),
    # a name that no example uses has no list of examples
    "log_level": {"backreference_missing": "info"},
}
warnings.filterwarnings("ignore", message="FigureCanvasAgg is non-interactive")

# Pages that list many others: the bar at the side of every page ends with them.
LISTS = ("api/generated/task-", "decisions/index")


def end_the_side_bar(app: Sphinx, env: BuildEnvironment) -> None:
    """Take the entries of the lists out of the navigation tree, which every page repeats."""
    for page in env.tocs:
        if page.startswith(LISTS):
            for entries in list(env.tocs[page].findall(toctree)):
                entries.parent.remove(entries)


def give_headings_a_level(_app: Sphinx, _page: str, _template: str, context: dict[str, Any], _tree: object) -> None:
    """State the level of the captions of lists of pages, which readers of screens need to list them."""
    for part in {"body", "furo_navigation_tree"} & set(context):
        context[part] = context[part].replace(
            'class="caption" role="heading"', 'class="caption" role="heading" aria-level="2"'
        )


def setup(app: Sphinx) -> None:
    app.connect("env-updated", end_the_side_bar)
    # after the theme has made the tree
    app.connect("html-page-context", give_headings_a_level, priority=900)


# single backticks in docstrings are names
default_role = "py:obj"

# The rooms are listed by their __all__, whichever file a name was written in.
autosummary_ignore_module_all = False
autosummary_context = {"returned": reference.returned_classes()}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
# by the names in the source, not by the unions behind them
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Floats", "Rng", "ErrorKind", "Answer")}
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
# as a list: otherwise a dataclass's fields are documented a second time, and a line of several names is misread
napoleon_custom_sections = [("Attributes", "params_style")]
napoleon_use_rtype = False
