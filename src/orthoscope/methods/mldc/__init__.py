"""The paper's method (MLDC) and its descendant (NMLDC)."""
