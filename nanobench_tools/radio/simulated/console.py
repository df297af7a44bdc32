"""What the vehicle says in plain text (console.c): packets of at most 30 bytes, at the end of a line at the latest."""

from ..crtp import MAX_DATA, Packet, Port


class Console:
    """Collects text; ``take`` gives it as packets."""

    def __init__(self) -> None:
        self._waiting: list[Packet] = []

    def say(self, line: str) -> None:
        """One line, without its end."""
        text = line.encode() + b"\n"
        self._waiting += [Packet(Port.CONSOLE, 0, text[i:i + MAX_DATA]) for i in range(0, len(text), MAX_DATA)]

    def take(self) -> list[Packet]:
        """Text since the last call."""
        found, self._waiting = self._waiting, []
        return found
