"""Chessboards: from corners of four squares to lattices, and which part of which board they are."""
