"""The public application layer: from a question, as a user asks it, to its answer.

``load`` makes a scenario of a map, a scene or a scenario file and of options over it;
``answer`` plans what it asks, as ``terrapath plan`` does.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
