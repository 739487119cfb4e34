"""Kernels of distance fields: stencils, fast marching, descent."""
