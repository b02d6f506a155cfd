"""Pictures, video and a window: muscles that show activation and force."""

from mjhill.rendering.bellies import draw_muscles as draw_muscles
from mjhill.rendering.film import View as View
from mjhill.rendering.film import render as render
from mjhill.rendering.film import snapshot as snapshot
from mjhill.rendering.viewer import view as view
