"""Physiological muscle for MuJoCo: the Hill-based system of Winters & Stark (1987)."""

from mjhill.install import install as install
