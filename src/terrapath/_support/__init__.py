"""Helpers for every package: files, memory, optional packages and progress."""
