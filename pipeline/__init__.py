"""Patchlight pipeline."""
