"""Loads and compiles what answers need; imported once, by the process from which all computations are forked."""

from __future__ import annotations

from ..geometry import Wall, focusing_arcs, koch
from .answers import Question, first_answer
from .drawing import pictured

for _wall in (Wall.from_vertices([(0, 0), (0.4, -0.3), (1, 0)]), focusing_arcs(1.0), koch(3)):
    first_answer(Question(_wall, ""))
    first_answer(Question(_wall, "", diffuse_fraction=0.5))
    pictured(Question(_wall, ""))
