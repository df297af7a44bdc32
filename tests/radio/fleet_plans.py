"""Plans of fleets for tests."""

from pathlib import Path

TWO = """
[[vehicle]]
name = "left"
uri = "udp://127.0.0.1:19850"
place = [0.0, -0.8]
trajectory = "circle"
speed = 0.5
size = 0.4
seconds = 4
controller = "onboard_pid"

[[vehicle]]
name = "right"
uri = "udp://127.0.0.1:19851"
place = [0.0, 0.8]
trajectory = "circle"
speed = 0.5
size = 0.4
seconds = 4
controller = "geometric"
delay_s = 1.0
"""


def fleet(folder: Path, *changes: tuple[str, str], text: str = TWO) -> Path:
    """File of a plan, with parts of the text replaced."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "fleet.toml"
    path.write_text(text)
    return path
