"""How Sphinx builds these pages; it needs asperity installed and no network."""

import sys
from pathlib import Path

import asperity
from asperity.ledger import entries
from asperity.ledger.text import page_of

# docs/ledger.md includes the rows
generated = Path(__file__).parent / "generated"
generated.mkdir(exist_ok=True)
(generated / "ledger.md").write_text(page_of(entries()), encoding="utf-8")
# docs/paper-figures.md includes the figures
sys.path.insert(0, str(Path(__file__).parent / "examples"))
import paper_figures  # noqa: E402

paper_figures.main(generated / "figures")
(generated / "figures.md").write_text(paper_figures.page(), encoding="utf-8")

project = "asperity"
author = "The asperity developers"
copyright = f"2026, {author}"
version = release = asperity.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["_build", "_templates", "generated"]
templates_path = ["_templates"]

html_theme = "furo"
html_title = f"asperity {release}"

myst_enable_extensions = ["amsmath", "dollarmath"]
myst_heading_anchors = 3

# The rooms are listed by their __all__, whichever file a name was written in.
autosummary_ignore_module_all = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
# by the names in the source, not by the unions behind them
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "Floats": "Floats"}
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
# as fields: an Attributes section would otherwise document a dataclass's fields a second time
napoleon_use_ivar = True
napoleon_use_rtype = False
