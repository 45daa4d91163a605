r"""
For a mathematician: bumps, from their law to a theorem
=======================================================

A wall of round bumps reflects particles at random. We take a family of such walls, look at the law, its symmetry and
its spectrum, compare the gap with the literature, prove it, and end with a wall for which no formula is known.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/published_gap.png"

import tempfile
import textwrap
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import sympy

from asperity import Estimate, verify
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from asperity.ledger import selected

# %%
# The family
# ----------
# The bumps are arcs of circles of curvature :math:`K`, one in each period. They are convex towards the particle, so
# that neighbouring rays separate. A dot marks where a ray enters, a ring where it leaves.

curvatures = [1 / 3, 1.0, 1.4]
fig, axes = plt.subplots(1, 3, layout="constrained", figsize=(10, 2.4))
for ax, K in zip(axes, curvatures, strict=True):
    geo.draw_wall(geo.dispersing_arcs(K), x=[0.25, 0.6], theta=[1.0, 1.9], ax=ax)
    ax.set_title(f"K = {K:.3g}")
plt.show()

# %%
# The law
# -------
# A particle comes in at the angle :math:`\theta` and enters at a point that is uniform on a period. It leaves at a
# random angle :math:`\theta'`. The law :math:`P(\theta, d\theta')` is an object, not a table. It can be sampled, and it
# can be applied to a function, here to the cosine at :math:`\theta = 1`.

law = ker.WallLaw(geo.dispersing_arcs(curvature=1.0))
outgoing = law.sample(np.full(100_000, 1.0), rng=0)
spread = 1.96 * np.cos(outgoing).std() / np.sqrt(outgoing.size)
exact = float(law.apply(np.cos, 1.0))
sampled = Estimate(np.cos(outgoing).mean(), spread, "estimate", "100,000 draws")
print(f"by sampling {sampled}, by quadrature {exact:.6f}")
assert abs(np.cos(outgoing).mean() - exact) < 2 * spread

# %%
# A matrix of the law on 48 intervals of equal measure :math:`\tfrac12\sin\theta\,d\theta`. The dashed line in the
# picture is retroreflection, the dotted line is specular reflection, to which these bumps are near.

P = ker.discretise(law, ker.Bins(48))
P.plot()
plt.show()

# %%
# Symmetry
# --------
# The reversed path of a ray is the path of a ray. Therefore :math:`P` is symmetric in
# :math:`L^2(\tfrac12\sin\theta\,d\theta)`, for every wall, and its spectrum is real. The defect of the matrix is that
# of the quadrature.

print(f"defect {P.symmetry_defect():.1e}, error of the matrix {float(P.error):.1e}")
assert law.reversible and float(P.symmetry_defect()) < 1e-4

# %%
# Bumps also have an axis of symmetry. Then :math:`P` commutes with :math:`Jf(\theta) = f(\pi - \theta)`, and its
# eigenfunctions are even or odd. In the paper's convention retroreflection is the identity. In the convention of Feres
# and Zhang specular reflection is, and their operator is :math:`PJ`. So even eigenvalues are the same in both, and odd
# eigenvalues change their sign.

theirs = law.in_specular_frame()
paper, specular = spec.spectrum(law, k=6), spec.spectrum(theirs, k=6)
signed = [(-1 if parity == "odd" else 1) * v for v, parity in zip(specular.values, specular.parity, strict=True)]
print("paper   ", np.sort(paper.values).round(6))
print("specular", np.sort(specular.values).round(6))
assert np.allclose(np.sort(signed), np.sort(paper.values), atol=1e-5)

# %%
# The spectrum
# ------------
# The gap is the distance between 1 and the rest of the spectrum, grey in the picture. On the right are eigenfunctions
# for flatter bumps, :math:`K = 1/3`. Away from grazing angles they resemble Legendre polynomials in :math:`\cos\theta`;
# we shall see why.

fig, (left, right) = plt.subplots(1, 2, layout="constrained", figsize=(12, 4.8))
specular.plot(left)
shallow = ker.WallLaw(geo.dispersing_arcs(1 / 3)).in_specular_frame()
spec.spectrum(shallow, k=4).plot_eigenfunctions(right)
plt.show()

# %%
# Eigenvalues of a matrix are not eigenvalues of the law. Residuals of trial functions give intervals that contain
# eigenvalues of the operator itself.

for found in spec.enclosures(theirs, 4):
    print(f"{found.low:.9f} to {found.high:.9f}")

# %%
# The gap
# -------
# For :math:`K = 1/3` Feres and Zhang (2010) published 0.0373. A gap is computed to a tolerance. It prints with its
# error in units of the last digit, and it has a verdict: *isolated* means that an eigenvalue ends it, and not the
# essential spectrum. The page :doc:`/generated/how-to/a_gap_with_its_error` has more.

gap = spec.spectral_gap(shallow, tolerance=1e-5)
print(f"{gap}, {gap.verdict}")
assert abs(float(gap) - 0.0373) < 5e-5 and gap.verdict == "isolated"

# %%
# And the whole family? Every point of a sweep has its error, which is below the thickness of the line here. The dashed
# line is :math:`K^2/3`.

grid = np.linspace(0.2, 1.4, 7)
table = spec.sweep(geo.dispersing_arcs, {"curvature": grid}, "gap_specular", tolerance=1e-4)
fig, ax = plt.subplots(layout="constrained")
table.plot(ax=ax)
ax.plot(grid, grid**2 / 3, "k--", linewidth=0.8, label="$K^2/3$")
ax.legend()
plt.show()

# %%
# The paper's ledger
# ------------------
# Where does :math:`K^2/3` come from? The ledger has every formula of the paper that can be checked. Its row S1.09 is
# the limit of shallow bumps: :math:`PJ - 1` tends to :math:`K^2/6` times Legendre's operator, whose first eigenvalue is
# :math:`-2`. The ledger says what is wrong with the formula as printed, and its check refutes the printed one.

(entry,) = selected(["S1.09"])
finding = entry.run()
print(textwrap.fill(f"{entry.statement} {entry.reason}", 88))
print(textwrap.fill(f"as printed: {finding.wrong.answer}, {finding.wrong.evidence}", 88))
print(textwrap.fill(f"corrected: {finding.right.answer}, {finding.right.evidence}", 88))
assert finding.as_stated

# %%
# So the :math:`l`-th deficit :math:`1 - \lambda_l` is about :math:`l(l + 1)K^2/6`. The ratios of both tend to 1.

for K in (0.4, 0.1):
    bumps = ker.WallLaw(geo.dispersing_arcs(K))
    found = spec.laplacian_comparison(bumps, degrees=3, tolerance=1e-7)
    ratios = found.deficits / (found.degrees * (found.degrees + 1) * K**2 / 6)
    print(f"K = {K}:", ratios.round(4))
assert np.allclose(ratios, 1.0, atol=5e-3)

# %%
# For other shallow walls :math:`K^2/6` is twice the mean squared slope :math:`h`. Is that right for bumps? With the
# slope angle :math:`s` at the corner, :math:`\sin s = K/2`, we claim :math:`h = \operatorname{artanh}(\sin s)/\sin s -
# 1`. The derivative of the integral is an identity that `verify` proves, and the series gives the constant.

s, k = sympy.symbols("s k", real=True)
integral = sympy.atanh(sympy.sin(s)) - sympy.sin(s)
integrand = sympy.tan(s) ** 2 * sympy.cos(s)
verdict = verify(sympy.diff(integral, s), integrand, [s > 0, s < sympy.pi / 2])
print(f"{verdict.answer} by {verdict.evidence}")
h = sympy.atanh(k / 2) / (k / 2) - 1
print("2 h =", sympy.series(2 * h, k, 0, 5))
assert verdict.answer == "proved"
slope = spec.mean_squared_slope(geo.dispersing_arcs(1.0))
assert np.isclose(float(h.subs(k, 1)), slope, rtol=1e-8)

# %%
# A theorem
# ---------
# So far every number is an estimate with an error. For bumps with :math:`K < \sqrt2` the gap can be proved, with all
# inequalities decided in ball arithmetic. The width is relative to the gap.

proof = spec.prove_gap(shallow, width=1e-2)
print(textwrap.fill(proof.statement, 88))
low, high = proof.interval
assert float(low) < float(gap) < float(high) < 1.01 * float(low)

# %%
# The proof is a file. It can be checked by anyone with python-flint and the 340 lines of the checker, without asperity.
# The page on :doc:`proved gaps </theory/proved-gaps>` has the lemmas with their proofs.

path = proof.save(Path(tempfile.mkdtemp()) / "gap.json")
print(f"{path.stat().st_size} bytes; checked:", *spec.check_proof(path).interval)
print("lemmas:", ", ".join(name for name, _ in proof.lemmas))

# %%
# A wall of your own
# ------------------
# A lopsided bump is a Bézier curve. It has no axis of symmetry.

own = geo.Wall([geo.Bezier([(0, -0.15), (0.15, 0.05), (0.5, 0.05), (1, -0.15)])])
fig, ax = plt.subplots(layout="constrained", figsize=(8, 2.4))
geo.draw_wall(own, x=[0.2, 0.5, 0.8], theta=[1.0, 1.6, 2.1], ax=ax)
plt.show()

# %%
# There is no theorem on this wall, and ``prove_gap`` says so. Its law is still reversible, so that its eigenvalues are
# real and can be enclosed. But it does not commute with :math:`J`: means of cosines at :math:`\theta` and :math:`\pi -
# \theta` are not opposite, and :math:`PJ` is not symmetric.

bump = ker.WallLaw(own)
try:
    spec.prove_gap(bump)
except InputError as refusal:
    print(str(refusal)[:90], "...")
print("means of cosines", bump.apply(np.cos, [0.4, np.pi - 0.4]).round(6))
intervals = [(found.low, found.high) for found in spec.enclosures(bump, 3)]
print(*(f"{low:.8f} to {high:.8f}" for low, high in intervals), sep="\n")
assert bump.reversible and not own.is_mirror_symmetric
assert intervals[1][1] < 1 and intervals[-1][0] > -1

# %%
# How many reflections does a particle need to forget its direction? The eigenvalue of largest modulus below 1 decides,
# here the negative one. To be within 1/4 of the invariant law in total variation, from any density of distance 1:

largest = max(abs(end) for interval in intervals[1:] for end in interval)
three = {"lopsided bump": bump, "bumps, K = 1": law, "bumps, K = 1/3": shallow}
for name, one in three.items():
    print(f"{name:14} at most {spec.mixing_time(one).steps} reflections")
assert largest ** spec.mixing_time(bump).steps <= 2 * 0.25

# %%
# Further: :doc:`/generated/how-to/a_sweep` over other families, :doc:`the errors </errors>` and what they mean,
# :doc:`formulas of your own </verifying>`, and :doc:`the objects of the paper </papers-objects>` by their names here.
