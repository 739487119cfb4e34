"""Kernels of surfaces: splines, the metric, lengths."""
