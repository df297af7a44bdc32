"""Files next to recordings that are no recordings: sheets apart, licences, read-mes, configurations, results."""

from __future__ import annotations

import json
import re
import tomllib

from .sheets import looks_like_sheet

FEWEST_WORDS = 30
"""Shorter texts prove nothing: a file of three words may as well be a recording that was lost."""

PICTURES = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"ply\n", b"ply\r\n")
"""First bytes of the images and point clouds of data sets, which are not read any further."""
_SENSOR_SHEET = re.compile(r"^(%YAML:1\.0\s*$|sensor_type:\s|T_BS:\s*$)", re.MULTILINE)
_TIME_SHEET = re.compile(r"^t_total:\s", re.MULTILINE)
_ALIGNMENT = re.compile(r"^align_type:\s", re.MULTILINE)
_KALIBR = re.compile(r"^\s*(camera_model|T_cam_imu|accelerometer_noise_density|target_type):\s", re.MULTILINE)
_FILE_LIST = re.compile(r"#?\s*timestamp\s*\[?\w*\]?\s*,\s*filename\s*$", re.MULTILINE)
_WORD = re.compile(r"[^\W\d_]{2,}[.,;:)]?")
_MARKDOWN_HEADING = re.compile(r"^#{1,6} \w", re.MULTILINE)
_USD_CONFIG = re.compile(r"^\s*on:\w+", re.MULTILINE)


def companion(data: bytes) -> str | None:
    """What kind of known companion a file is, by its content (sheet, usd config, ros bag, toml, ...), or None."""
    if b"\x00" in data[:4096]:
        return None
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        return None
    if looks_like_sheet(data):
        return "sheet"
    if _SENSOR_SHEET.search(text):
        return "sensor sheet"
    if _TIME_SHEET.search(text):
        return "time sheet"
    if _ALIGNMENT.match(text):
        return "alignment of rpg_trajectory_evaluation"
    if _KALIBR.search(text):
        return "calibration of Kalibr"
    if _FILE_LIST.match(text):
        return "list of pictures"
    if _USD_CONFIG.search(text) and any(line.split("#")[0].strip().isdigit() for line in text.splitlines()):
        return "usd config"
    if text.startswith("rosbag2_bagfile_information:"):
        return "ros bag"
    if text.lstrip()[:1] in ("{", "["):
        try:
            if isinstance(json.loads(text), dict):
                return "json"
        except (ValueError, RecursionError):
            pass
    if "=" in text:
        try:
            if tomllib.loads(text):
                return "toml"
        except (tomllib.TOMLDecodeError, RecursionError):
            pass
    return "prose" if _is_prose(text) else None


def _is_prose(text: str) -> bool:
    """Sentences or a page of Markdown, not a table: many words between blanks, and more of them than numbers."""
    pieces = text.split()
    words = sum(bool(_WORD.fullmatch(p.strip("\"'`*_([<>])"))) for p in pieces)
    numbers = sum(any(c.isdigit() for c in p) for p in pieces)
    if words < FEWEST_WORDS:
        return False
    return len(_MARKDOWN_HEADING.findall(text)) >= 2 or (3 * words > len(pieces) and words > numbers)
