"""Spectra and spectral gaps of reflection laws, and their consequences, with errors.

Names are imported on first use, so ``import asperity`` is quick. The stub beside this file lists their modules.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
