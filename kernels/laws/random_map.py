"""The former name of `Law.random_map`."""

from __future__ import annotations

from .law import Law, RandomMap


def responder(law: Law) -> RandomMap | None:
    """`Law.random_map`."""
    return law.random_map()
