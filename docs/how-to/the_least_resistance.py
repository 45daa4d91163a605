r"""
The least resistance
====================

A convex body tumbles through a thin medium. Roughness changes its resistance by a factor between 0.98782 and 3/2.
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import kernels as ker

# %%
# Lower and upper bounds over all laws of walls:

least, most = ker.extremal_resistance(1024), ker.extremal_resistance(8, "max")
print(f"least from {least.lower:.8f} to {least.upper:.8f}, greatest {most.upper}")

# %%
# The law of least resistance. Where two lines are drawn for one incoming angle, both outcomes have a probability.

theta = np.linspace(0.0, np.pi, 1202)[1:-1]
probability, outgoing = least.law.images(theta)
fig, ax = plt.subplots(layout="constrained")
for slot in (0, 1):
    used = probability[:, slot] > 0
    dots = ax.scatter(theta[used], outgoing[used, slot], c=probability[used, slot], s=3, vmin=0, vmax=1)
fig.colorbar(dots, label="probability")
ax.set(xlabel="incoming angle (radians)", ylabel="outgoing angle (radians)", aspect="equal")
plt.show()

# %%
# What triangular teeth do, by their apex angle. The best are slightly sharper than a right angle.

angles = np.linspace(0.3, 3.0, 60)
values = [float(ker.resistance(ker.TriangularTeethLaw(a))) for a in angles]
best = ker.design_wall(ker.resistance, ker.TriangularTeethLaw, [(0.2, 3.0)])
print(f"apex angle {best.parameters[0]:.5f}, resistance {best.value}")

fig, ax = plt.subplots(layout="constrained")
ax.plot(angles, values)
ax.plot(best.parameters[0], float(best.value), "o")
for level, name in ((least.lower, "least"), (1.0, "smooth"), (most.upper, "greatest")):
    ax.axhline(level, color="0.6", linewidth=0.8)
    ax.annotate(name, (2.5, level), xytext=(0, -11 if name == "least" else 3), textcoords="offset points")
ax.set(xlabel="apex angle (radians)", ylabel="resistance / resistance of the smooth body")
plt.show()
