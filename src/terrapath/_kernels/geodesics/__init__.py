"""Kernels of geodesics: the equation, rays, refinement."""
