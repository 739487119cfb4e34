"""Kernels of certificates: Taylor models and what they prove of a cell."""
