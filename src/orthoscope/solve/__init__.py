"""Least squares that knows no camera."""
