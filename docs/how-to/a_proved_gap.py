r"""
A proved gap
============

For bumps of a curvature below :math:`\sqrt2` the gap can be proved to lie in an interval, with all inequalities decided
in ball arithmetic.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

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

# %%
# The proof in pictures. Rays meet the bumps, here steeper than those of the proof, once or twice and no more. A count
# in bins of the rays that meet them once shows the thresholds at the ends of the bands: below there is at most one
# eigenvalue of :math:`1 - P` on odd functions of the angle about the vertical, and none on even ones. A trial function
# and Temple's inequality then enclose the lowest one: on the right, beside the published value and the estimate of
# `spectral_gap`.

fig, (left, middle, right) = plt.subplots(1, 3, layout="constrained", figsize=(10, 3.2), width_ratios=(1.1, 1, 1))
geo.draw_wall(geo.dispersing_arcs(curvature=1.0), [-0.2, 0.7], [1.3, 0.8], ax=left)
left.set(title="once or twice", xlim=(-0.6, 1.6), ylim=(-0.35, 0.7))

steps = 1.0 - spec.spectrum(law, 5).values[1:]
for level, (known, found) in enumerate(zip(("threshold", "other"), (steps[0::2], steps[1::2]), strict=True)):
    middle.barh(-level, float(proof.certificate[known]), height=0.5, color="#0072B2", alpha=0.3)
    middle.plot(found, np.full(len(found), -level), "o", color="#D55E00")
middle.set(title="eigenvalues and thresholds", xlim=(0, 0.4), ylim=(-1.6, 0.6), xlabel="eigenvalue of 1 - P")
middle.set_yticks([0, -1], labels=["odd:\nat most one", "even:\nnone"])

gap = spec.spectral_gap(law, tolerance=1e-6)
low, high = map(float, proof.interval)
for level, (value, half) in enumerate(((0.0373, 5e-5), ((low + high) / 2, (high - low) / 2), (gap.value, gap.error))):
    right.errorbar(1e6 * (value - 0.0373), -level, xerr=1e6 * half, fmt=".", color="#0072B2", capsize=4)
right.set(title="the gap", xlabel="(gap - 0.0373) in millionths", xlim=(-60, 60), ylim=(-2.6, 0.6))
right.set_yticks([0, -1, -2], labels=["Feres and\nZhang 2010", "proved\ninterval", "estimate"])
plt.show()
