from . import metric as metric
from .layers import Layer as Layer
from .mask import Mask as Mask
from .smoothing import Smoothing as Smoothing
from .surface import Fit as Fit, Surface as Surface
