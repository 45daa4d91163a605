r"""
A proved gap
============

For bumps of a curvature below :math:`\sqrt2` the gap can be proved to lie in an interval, with all inequalities decided
in ball arithmetic.
"""

import tempfile
from pathlib import Path

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# The width is relative to the gap. Five to forty seconds give 1e-5.

law = ker.WallLaw(geo.dispersing_arcs(curvature=1 / 3)).in_specular_frame()
proof = spec.prove_gap(law, width=1e-4)
print(proof.statement)

# %%
# The certificate is a file. ``python checker.py < gap.json`` checks it with python-flint alone, ``check_proof`` here.

path = proof.save(Path(tempfile.mkdtemp()) / "gap.json")
assert spec.check_proof(path).interval == proof.interval

# %%
# The lemmas that the theorem rests on; their proofs are on the page :doc:`Proved gaps </theory/proved-gaps>`.

for name, lemma in proof.lemmas:
    print(f"{name}: {lemma}")
