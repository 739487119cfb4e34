"""The public application layer: from a question to its answer."""
