"""Where a path may go: free space, constraints, slope limit, reachability; the lattice over it."""
