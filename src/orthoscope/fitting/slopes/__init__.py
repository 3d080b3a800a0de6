"""How images and residuals move with what is fitted, and a fit made linear by it."""
