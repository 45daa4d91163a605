"""Reflection laws and collision laws as Markov kernels: bases, laws and their algebra, matrices, estimation.

Names are imported when they are first used, so that ``import asperity`` stays quick; the stub beside this file says
where each one is at home.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
