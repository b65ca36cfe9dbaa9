"""The solver: form factors, visibility, radiosity, sky and sun on curved patches."""
