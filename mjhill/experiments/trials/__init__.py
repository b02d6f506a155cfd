"""Single trials on the bench, each with what is measured of it."""
