"""Offscreen pictures and video of recordings: muscles that show activation and force."""

from mjhill.rendering.film import View as View
from mjhill.rendering.film import render as render
from mjhill.rendering.film import snapshot as snapshot
