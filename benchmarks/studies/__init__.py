"""Studies in simulation: what is true is known, so what is said can be judged."""
