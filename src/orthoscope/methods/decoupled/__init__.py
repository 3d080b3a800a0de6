"""Calibration in two steps: the target's shape and a free lens first, then the camera."""
