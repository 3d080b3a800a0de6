"""Lenses: what one is, the formulas, the free one, their inverses and where they end."""
