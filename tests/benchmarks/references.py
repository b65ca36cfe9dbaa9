"""Scenes whose light is known in closed form, beside the benchmark's cases."""

REFERENCES = ()
