"""``python -m mjhill``: the command line."""

from mjhill.cli import main

main()
