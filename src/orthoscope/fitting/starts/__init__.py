"""Where a fit starts: closed forms, and a camera and poses near enough."""
