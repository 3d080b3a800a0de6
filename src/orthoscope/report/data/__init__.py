"""What the page shows, as numbers that its script draws."""
