"""Task files."""

BOX = """
name = "pocket"
[workspace]
frame = "part"
shape = "box"
center_mm = [100.0, 0.0, 50.0]
size_mm = [500.0, 700.0, 300.0]
[[workspace.orientation]]
quaternion = [0.0, 0.955, 0.0, 0.296]
cone_deg = 20.0
spin = "free"
[[workspace.orientation]]
quaternion = [0.0, 1.0, 0.0, 0.0]
[frames.part]
position_mm = [1600.0, 30.0, 1400.0]
quaternion = [0.0, 0.0, 0.70710678, 0.70710678]
[accuracy]
position_mm = 0.1
"""


CYLINDER = """
name = "ring"
[workspace]
shape = "cylinder"
center_mm = [1700.0, 0.0, 1400.0]
radius_mm = 200.0
height_mm = 300.0
axis = [1.0, 1.0, 0.0]
[[workspace.orientation]]
quaternion = [0.0, 0.955, 0.0, 0.296]
spin_deg = 15.0
"""


def written(folder, text: str, name: str = "task.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path
