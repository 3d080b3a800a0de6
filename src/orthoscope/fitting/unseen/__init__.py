"""Views left out: the error on them, by fits or by one linear step, and how the camera scatters."""
