"""Scene files for tests."""


def write(folder, text):
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path
