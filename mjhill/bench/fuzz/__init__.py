"""Random models with anything that is accepted: does a run fail without a word."""
