"""The command ``mjhill view``."""

from __future__ import annotations

import click


@click.command()
@click.argument("model")
@click.option("--paused", is_flag=True, help="Wait for Space at the start.")
@click.option(
    "--speed", default=1.0, show_default=True, help="1 is real time, 0.1 is ten times slower."
)
def view(model: str, paused: bool, speed: float) -> None:
    """Run MODEL, a joint's name or a path, in a window with a slider for each excitation.

    Space runs or pauses, the right arrow steps while paused, the left arrow goes back, Backspace
    restarts, - and = change the speed. Ctrl-C or closing the window ends the command.
    """
    from mjhill.draw import view as show
    from mjhill.simulate.load import load

    loaded = load(model)
    show(loaded, paused=paused, speed=speed)
