"""The verdict: how far off a camera is, where that holds, what limits it, and what to do about it."""
