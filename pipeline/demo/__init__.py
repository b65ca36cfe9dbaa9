"""Demo scenes, built in CadQuery."""
