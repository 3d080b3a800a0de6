"""Corners and views that do not belong, found and left out."""
