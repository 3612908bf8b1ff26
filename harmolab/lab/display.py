"""Records of the core as HTML: a sound and a clip play, beats, poses and scores are pictures.

Jupyter asks for it (`harmolab.types.Display`). All of it works without a network; text is escaped. Sound, players and
pictures of beats hold the first minute at most, and say so, since each copy of them is kept in the notebook.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import singledispatch
from html import escape
from typing import Any

from harmolab.lab.figures.beats import beat_strip, claim, headline, png_text, score_figure
from harmolab.lab.figures.people import pose_row
from harmolab.lab.player_data import coded_sound, player_of
from harmolab.score import HarmonyScore
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.judge import Judgement

LONGEST = 60.0  # seconds; a minute of sound is half a megabyte


@singledispatch
def record_html(record: object) -> str:
    """A record as HTML: its line, and below it a player or a picture where it has one."""
    return f"<div>{escape(repr(record))}</div>"


@record_html.register
def _(audio: Audio) -> str:
    try:
        sound = coded_sound(audio, min(audio.duration, LONGEST))["ogg"]
    except ValueError as error:  # a rate that no browser plays
        return _lines([repr(audio), str(error)])
    player = f'<audio controls src="data:audio/ogg;base64,{sound}"></audio>'
    return _lines([repr(audio), *_part(audio.duration)]) + player


@record_html.register
def _(track: BeatTrack) -> str:
    strip = _picture(beat_strip(track, longest=LONGEST), f"{len(track)} beats")
    return _lines([repr(track), *_part(track.duration)]) + strip


@record_html.register
def _(motion: Motion) -> str:
    return _lines([repr(motion)]) + _picture(pose_row(motion), "poses")


@record_html.register
def _(clip: Clip) -> str:
    name = clip.name.encode("utf-8", "replace").decode() or "a clip"  # a name of a file may be no text
    try:
        shared = replace(clip, name=name).shared()
        part = shared.span(0.0, LONGEST) if shared.audio.duration > LONGEST else shared
        player = player_of([part], title=name)
    except ValueError as error:  # no motion, or one that cannot be played or scored
        return _lines([repr(clip), str(error)]) + record_html(clip.audio)
    return _lines([repr(clip), clip.source, *_part(shared.audio.duration)]) + player._repr_html_()


@record_html.register
def _(score: HarmonyScore) -> str:
    text = [claim(score), headline(score), *_part(score.music.duration)]
    figure = score_figure({"": score}, longest=LONGEST)
    figure.axes[0].set_title("", loc="left")  # it stands above, as text
    return _lines(text) + _picture(figure, claim(score))


@record_html.register
def _(judgement: Judgement) -> str:
    return _lines([f"{judgement.verdict} (level {judgement.level} of 4)", *judgement.remarks])


def _lines(texts: Iterable[str]) -> str:
    """Paragraphs, the first in bold."""
    first, *others = (escape(text.encode("utf-8", "replace").decode()) for text in texts)
    return f"<div><b>{first}</b></div>" + "".join(f"<div>{text}</div>" for text in others if text)


def _part(duration: float) -> list[str]:
    """The sentence that not all of it is there, where that is so."""
    return [f"Below: the first {LONGEST:g} s of {duration:.0f} s."] if duration > LONGEST else []


def _picture(figure: Any, name: str) -> str:
    """A figure of matplotlib in the page; `name` is read out where it cannot be seen."""
    return f'<img alt="{escape(name)}" style="max-width: 100%" src="data:image/png;base64,{png_text(figure)}">'
