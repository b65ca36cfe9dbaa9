"""Patchlight importers."""
