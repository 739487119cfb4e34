"""Kernels of planners: trees and graph searches."""
