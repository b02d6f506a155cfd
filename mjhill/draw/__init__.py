"""Pictures, video and a window: muscles that show activation and force."""

from mjhill.draw.bellies import draw_muscles as draw_muscles
from mjhill.draw.film import View as View
from mjhill.draw.film import frames as frames
from mjhill.draw.film import render as render
from mjhill.draw.film import snapshot as snapshot
from mjhill.draw.viewer import view as view
