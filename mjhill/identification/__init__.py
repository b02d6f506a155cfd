"""Identification: parameters fitted to measured movement."""
