"""Discs: their outlines, their centres and how they lie."""
