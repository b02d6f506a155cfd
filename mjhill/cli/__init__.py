"""The command line ``mjhill``."""

from mjhill.cli.commands import main as main
