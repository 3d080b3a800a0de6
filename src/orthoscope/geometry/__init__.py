"""Arrays, poses, homographies, cells of a frame, numbers as text, how many things at once."""
