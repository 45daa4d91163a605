"""Reflection laws and collision laws as Markov kernels: bases, laws and their algebra, matrices, estimation.

Names are imported when they are first used, so that ``import asperity`` stays quick; the stub beside this file says
where each one is at home.

- Take and combine laws: Conditionals, DensityLaw, IntervalExchangeLaw, InvolutionLaw, Law, LeastResistanceLaw,
  MatrixLaw, henyey_greenstein, lambertian, maxwell, retroreflection, specular, HemisphereLaw, SurfaceLaw.
- Take the law of a wall: CircularArcLaw, FacetedLaw, MushroomLaw, PolygonLaw, RectangularTeethLaw, TriangularTeethLaw,
  WallLaw.
- Compute the matrix of a law: discretise, estimate, estimate_stream, KernelMatrix, load_matrix, Basis, Bins,
  Legendre, Panels, SINE, SINE_SQUARED, TensorBasis, Zernike.
- Compare laws: difference_test, distance, retroreflection_distance.
- Collide disks: CollisionLaw, SatelliteLaw, limit_study, no_slip, no_slip_matrix, smooth, smooth_matrix, weak_limit.
- Find the least and greatest resistance: PolygonalBody, RoughBody, extremal_resistance, invisible_body, resistance,
  spin_force, zero_resistance_body.
- Find a wall for a law: collision_for, design_wall, dichotomy, exchange_hollow, wall_for.
- Play billiards and gases: CollisionAlongWall, PairLaw, lyapunov_exponent, play, play_gas.
- Let the law depend on the position: PositionLaw, displacements, position_distance.
- Reflect from walls that move: SpringWall.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
