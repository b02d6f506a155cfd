"""The figures of experiments, in the form of the paper's."""
