"""Methods and lenses compared by the views that they were not made from."""
