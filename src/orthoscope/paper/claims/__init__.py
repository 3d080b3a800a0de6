"""The paper's sentences, what becomes of each, and where a figure or a table shows it."""
