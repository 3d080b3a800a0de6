"""Lenses, cameras, the target's shape."""
