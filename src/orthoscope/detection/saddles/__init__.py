"""Corners where four squares meet, to a fraction of a pixel."""
