"""Benchmarks: what is measured against the clock, the truth and the peers, and its report."""
