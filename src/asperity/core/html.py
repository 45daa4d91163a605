"""Values as small tables in notebooks, and text that pictures show as it is."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape


def verbatim(text: str) -> str:
    r"""Text of a user for matplotlib, which shows it letter by letter: nothing in it is a formula.

    Examples
    --------
    >>> print(verbatim(r"load $\frac{$"))
    load \$\frac{\$
    """
    # fonts have no letters for halves of surrogate pairs
    return text.encode("utf-8", "replace").decode().replace("$", r"\$")


def html_table(title: str, lines: Mapping[str, object], picture: str = "") -> str:
    """A title, a picture and one row a fact; lines that are None or empty are left out.

    Parameters
    ----------
    picture : str
        HTML, as it stands; all other text is escaped.

    Examples
    --------
    >>> html_table("a < b", {"error": 0.5, "method": None})
    '<div><b>a &lt; b</b><table><tr><th>error</th><td>0.5</td></tr></table></div>'
    """
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(str(value))}</td></tr>"
        for name, value in lines.items()
        if value is not None and value != ""
    )
    return f"<div><b>{escape(title)}</b>{picture}<table>{rows}</table></div>"
