"""Arrays in, numbers out; imports nothing of mjhill."""
