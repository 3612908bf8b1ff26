"""The offset of a dance in its song when no file states it.

The movement gives it modulo the beat (`find_offset`); the sound that a camera recorded gives it outright
(`find_sound_offset`). `picture_motion` makes a video into something that the first can read.
"""

from harmolab.alignment.movement import attack_beats, find_offset, picture_motion, rest_at_beats
from harmolab.alignment.sound import find_sound_offset

__all__ = ["attack_beats", "find_offset", "find_sound_offset", "picture_motion", "rest_at_beats"]
