"""Mazes: corridors of one cell that join all their rooms in exactly one manner."""

import numpy as np


def maze(random, rows, columns):
    """(rows, columns) bool, the blocked cells of a random maze that begins in its first corner."""
    blocked = np.ones((rows, columns), bool)
    blocked[0, 0], stack = False, [(0, 0)]
    while stack:
        j, i = stack[-1]
        steps = [(0, 2), (0, -2), (2, 0), (-2, 0)]
        ahead = [
            (b, a)
            for b, a in steps
            if 0 <= j + b < rows and 0 <= i + a < columns and blocked[j + b, i + a]
        ]
        if not ahead:
            stack.pop()
            continue
        b, a = ahead[random.integers(len(ahead))]
        blocked[j + b // 2, i + a // 2] = blocked[j + b, i + a] = False
        stack.append((j + b, i + a))
    return blocked
