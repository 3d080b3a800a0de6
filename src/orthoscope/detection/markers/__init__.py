"""Boards with markers: which marker is read, and the corners that it gives."""
