"""Selling's algorithm: the superbase that makes a tensor a sum of squares (Selling 1874)."""

from typing import NamedTuple

from ..compiler import inner_kernel

# The largest number of superbase flips; about log2 of the anisotropy are needed.
MOST_FLIPS = 200


class Superbase(NamedTuple):
    """Lattice vectors b_0, b_1 of a basis; b_2 = -b_0 - b_1 completes the superbase."""

    x0: float
    y0: float
    x1: float
    y1: float


class Products(NamedTuple):
    """Products b_k^T D b_l of a superbase's vectors."""

    p01: float
    p12: float
    p20: float


@inner_kernel
def products(d, b):
    """The products of a superbase under the tensor d."""
    c0x, c0y = d.h11 * b.x0 + d.h12 * b.y0, d.h12 * b.x0 + d.h22 * b.y0
    c1x, c1y = d.h11 * b.x1 + d.h12 * b.y1, d.h12 * b.x1 + d.h22 * b.y1
    p01 = c0x * b.x1 + c0y * b.y1
    return Products(p01, -p01 - c1x * b.x1 - c1y * b.y1, -p01 - c0x * b.x0 - c0y * b.y0)


@inner_kernel
def obtuse_superbase(d, b):
    """The D-obtuse superbase that Selling's algorithm makes of b.

    b : where it begins. The superbase of a neighbouring node is mostly right already.
    """
    for _ in range(MOST_FLIPS):
        p = products(d, b)
        if p.p01 > 0.0:
            b = Superbase(b.x1, b.y1, -b.x0, -b.y0)
        elif p.p12 > 0.0:
            b = Superbase(-b.x1, -b.y1, -b.x0 - b.x1, -b.y0 - b.y1)
        elif p.p20 > 0.0:
            b = Superbase(b.x0, b.y0, b.x0 + b.x1, b.y0 + b.y1)
        else:
            break
    return b
