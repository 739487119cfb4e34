"""Optimal paths on terrain, with proof.

The public names stand in ``__init__.pyi``; each is imported at its first use, so that
``import terrapath`` costs next to nothing.
"""

import lazy_loader

from ._version import __version__ as __version__

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
