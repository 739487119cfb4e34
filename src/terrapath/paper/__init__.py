"""The paper's experiments, each a function that returns data, and their report."""
