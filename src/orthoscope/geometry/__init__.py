"""Arrays, poses, homographies, cells of a frame, numbers as text."""
