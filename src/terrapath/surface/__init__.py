"""Floor 1: surfaces. See ``surface.Surface``."""

from .layers import Layer
from .mask import Mask
from .smoothing import Smoothing
from .surface import Fit, Surface

__all__ = ["Fit", "Layer", "Mask", "Smoothing", "Surface"]
