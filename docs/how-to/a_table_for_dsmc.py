r"""
A table for a DSMC code
=======================

Another code draws outgoing angles from a table: how large it should be, and how to check the code that reads it.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from asperity import Estimate
from asperity import geometry as geo
from asperity import kernels as ker

# %%
# A table has the quantiles of the outgoing angle for equally spaced incoming angles and probabilities. Its ``error`` is
# the mean error in radians of the angles drawn by interpolation. Of round bumps it falls with the size of the table.
# Teeth with flat sides reflect a beam into a few directions, and a table blurs the jumps between them. Take the
# smallest table whose error your code would not notice.

walls = {"round bumps": geo.dispersing_arcs(curvature=1.0), "triangular teeth": geo.triangular_teeth(1.5)}
sizes = [8, 16, 32, 64, 128]
tables = {name: [ker.WallLaw(wall).table(n, n + 1, 1e-3) for n in sizes] for name, wall in walls.items()}
fig, ax = plt.subplots(layout="constrained")
for name, found in tables.items():
    ax.plot(sizes, [table.error for table in found], "o-", label=name)
ax.set(
    xscale="log",
    yscale="log",
    xlabel="number of incoming angles in the table",
    ylabel="mean error of the angle (radians)",
)
ax.set_xticks(sizes, labels=sizes)
ax.minorticks_off()
ax.legend()
plt.show()

# %%
# The file states unit, convention, grid and errors in comments. The page about :doc:`tables </tables>` has samplers in
# NumPy, C++ and Fortran, and :doc:`SPARTA </sparta>` runs with one.

law, table = ker.WallLaw(walls["round bumps"]), tables["round bumps"][3]
path = table.save(Path(tempfile.mkdtemp()) / "law.csv")
print(*path.read_text().splitlines()[:7], sep="\n")

# %%
# A check for every sampler: the moments of drawn angles against those of the law. They agree up to the error of the
# table and the spread of the draws. Incoming angles with the cosine law have to leave with it, whatever the wall.

rng = np.random.default_rng(0)
for theta in (0.3, 1.0, 1.5):
    drawn = np.cos(table.sample(np.full(100_000, theta), rng))
    mean = Estimate(drawn.mean(), 1.96 * drawn.std() / 100_000**0.5, "estimate", "100,000 draws")
    print(f"incoming angle {theta}: mean cosine {mean}, law {float(law.apply(np.cos, theta)):.4f}")
cosines = np.cos(table.sample(ker.SINE.sample(100_000, rng), rng))
print(f"after the cosine law: mean square of the cosine {np.mean(cosines**2):.4f}, within 0.0018, to be 1/3")
