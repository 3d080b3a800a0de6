"""A file for each tool, both directions."""
