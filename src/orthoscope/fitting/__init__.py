"""What the methods share: observations, reprojection, starts, poses, held-out views."""
