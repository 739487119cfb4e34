"""Travel models: what a metre costs in time or energy, uphill and downhill."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
