"""Published values, and the readers of them."""
