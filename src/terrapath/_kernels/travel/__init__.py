"""Kernels of travel models: a pace, its derivatives and its lower lines."""
