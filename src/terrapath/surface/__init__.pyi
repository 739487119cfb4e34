from . import metric as metric
from .bounds import Mask as Mask
from .layers import Layer as Layer
from .smoothing import Smoothing as Smoothing
from .surface import Fit as Fit, Surface as Surface
