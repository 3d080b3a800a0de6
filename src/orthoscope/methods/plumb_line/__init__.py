"""Lenses from photographs without a target: edges that are straight in space (the plumb line)."""
