"""What is photographed, and what was found of it."""
