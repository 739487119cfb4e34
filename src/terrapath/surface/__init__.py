"""Floor 1: surfaces. See ``surface.Surface``."""

from .mask import Mask
from .smoothing import Smoothing
from .surface import Fit, Layer, Surface

__all__ = ["Fit", "Layer", "Mask", "Smoothing", "Surface"]
