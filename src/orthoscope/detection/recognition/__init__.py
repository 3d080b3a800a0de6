"""Which target photographs show, before anybody has said so."""
