"""The paper's experiments (sect. 4 and 5), one a file."""
