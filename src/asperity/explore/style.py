"""How the page looks: styles of its text, dark where the system is, and as wide as the screen of a phone."""

from __future__ import annotations

TEXT = """
:host { font-family: system-ui, sans-serif; }
.asperity-answers td { padding: 1px 10px 1px 0; vertical-align: top; overflow-wrap: anywhere; }
.asperity-answers td:first-child { opacity: 0.75; white-space: nowrap; }
"""
# In every component, where the light colours of panel come later.
COMPONENTS = """
.bk-btn.bk-active { outline: 2px solid #56B4E9; outline-offset: -2px; }
@media (prefers-color-scheme: dark) {
  :host {
    --panel-background-color: #1b1e22 !important; --panel-on-background-color: #e8e8e8 !important;
    --panel-surface-color: #2b3035 !important; --panel-on-surface-color: #e8e8e8 !important;
    --panel-secondary-color: #343a40 !important; --panel-on-secondary-color: #ffffff !important;
    --panel-border-color: #4a4f55 !important; --color: #d0d0d0 !important; --file: #343a40 !important;
  }
  select.bk-input { appearance: auto !important; background-image: none !important; }
  .noUi-target { background: #2b3035; border-color: #4a4f55; box-shadow: none; }
  .noUi-connect { background: #6a7078; }
}
"""
# Of the whole page; bokeh draws axes and text in the colours that begin with --bk.
HEAD = """
{% block postamble %}
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
@media (prefers-color-scheme: dark) {
  :root {
    color-scheme: dark; background: #1b1e22; --icon-color: #b0b0b0; --bk-text-color: #e8e8e8;
    --bk-background-fill-color: #1b1e22; --bk-border-fill-color: #1b1e22;
    --bk-outline-line-color: #4a4f55; --bk-grid-line-color: #4a4f55;
    --bk-axis-line-color: #b0b0b0; --bk-major-tick-line-color: #b0b0b0; --bk-minor-tick-line-color: #b0b0b0;
    --bk-major-label-text-color: #d0d0d0; --bk-axis-label-text-color: #d0d0d0;
  }
}
</style>
{% endblock %}
"""
