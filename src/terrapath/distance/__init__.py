"""Distance fields: how far every node of a lattice is from a source."""
