"""Tests of whether residuals agree from view to view, which noise does not."""
