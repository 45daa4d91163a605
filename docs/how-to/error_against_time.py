r"""
Error against time
==================

Which method computes a number fastest, and how does its error fall with the work?
"""

import math

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import qmc

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# The number: the resistance of right-angled teeth, which is :math:`\sqrt2`.

wall = geo.triangular_teeth(angle=math.pi / 2)
problem = spec.WorkProblem("resistance of right-angled teeth", spec.ReferenceValue(math.sqrt(2), 0.0, "closed form"))

# %%
# The resistance is a mean over entry points and angles of rays. They are drawn independently, or by a scrambled Sobol
# sequence.


def mean_over_rays(points):
    theta = ker.SINE.quantile(points[:, 1])
    turned = geo.trace(wall, points[:, 0], theta).theta - theta
    return (0.75 * (1.0 + np.cos(turned))).mean()


def independent(rays, rng):
    return mean_over_rays(rng.random((rays, 2)))


def sobol(rays, rng):
    return mean_over_rays(qmc.Sobol(2, rng=rng).random(rays))


methods = [
    spec.WorkMethod("independent rays", independent, is_random=True, order=0.5),
    spec.WorkMethod("Sobol sequence", sobol, is_random=True),
]
report = spec.work_precision(problem, methods, [2**k for k in range(8, 17)], repeats=12, seconds=2.0)

# %%
# Errors are root mean squares over the repeats. The fitted order says how they fall with the number of rays.

for method in methods:
    print(f"{method.name}: order {report.order(method.name).order:.2f}")
fig, ax = plt.subplots(layout="constrained")
report.plot(ax)
plt.show()

# %%
# The library itself takes neither method for this wall, because the law of its teeth has a closed form:

print(ker.resistance(ker.WallLaw(wall)))
assert np.isclose(float(ker.resistance(ker.WallLaw(wall))), math.sqrt(2))
