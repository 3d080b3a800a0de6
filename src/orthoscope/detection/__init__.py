"""From photographs to corners."""
