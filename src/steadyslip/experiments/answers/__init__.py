"""What follows from a fit: how sure it is, which law, another machine, the next experiment."""
