"""Patchlight reports."""
