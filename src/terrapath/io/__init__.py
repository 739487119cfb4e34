"""Reads maps and obstacles; writes routes and distance fields.

Each name is imported at its first use: reading maps needs libraries that writing a route does not.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
