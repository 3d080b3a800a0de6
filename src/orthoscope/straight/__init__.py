"""Photographs and films without their distortion."""
